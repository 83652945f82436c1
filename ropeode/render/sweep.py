"""A sweep: its design, its progress, and what became of each stepper."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from ropeode.render.markup import Block, Grid, Heading, Paragraph
from ropeode.render.results import blocks, line, rows
from ropeode.sweep import STATUSES, StepperSummary, SweepSummary
from ropeode.validation import shown

_STATUS = ("status", "cases", "meaning")
_STEPPER = ("stepper", "runs", "max error", "order", "largest stable dt")
_REASONS = 5
_LONGEST_REASON = 200


@line.register
def _(summary: SweepSummary) -> str:
    return f"{summary.folder}: {summary.done} of {summary.total} cases"


@blocks.register
def _(summary: SweepSummary) -> list[Block]:
    statuses = [
        (status, str(number), meaning)
        for status, meaning in STATUSES.items()
        if (number := summary.statuses[status])
    ]
    steppers = [(name, *_results(each)) for name, each in summary.steppers.items()]
    parts: list[Block] = [
        Heading(f"Sweep in {line(summary)}"),
        Paragraph("\n".join(_design_words(summary.spec))),
        Grid(_STATUS, statuses, left=frozenset({0, 2}), long=frozenset({2})),
        Grid(_STEPPER, steppers, left=frozenset(range(5)), long=frozenset(range(1, 5))),
    ]
    if summary.reasons:
        words = "\n".join(_reason_words(summary))
        parts += [Paragraph(f"Most frequent reasons:\n{words}")]
    return parts


@rows.register
def _(summary: SweepSummary) -> list[dict[str, Any]]:
    return [
        {
            "stepper": name,
            **each.counts["status"],
            **{
                f"{column}_{end}": value
                for column, ends in each.ranges.items()
                for end, value in zip(("least", "greatest"), ends, strict=True)
            },
        }
        for name, each in summary.steppers.items()
    ]


def _reason_words(summary: SweepSummary) -> Iterator[str]:
    for (status, reason), number in [*summary.reasons.items()][:_REASONS]:
        cut = reason if len(reason) <= _LONGEST_REASON else f"{reason[:_LONGEST_REASON]}..."
        yield f"{number} {status}: {cut}"
    if (more := len(summary.reasons) - _REASONS) > 0:
        yield f"and {more} others"


def _design_words(spec: Mapping[str, Any]) -> list[str]:
    """The problem and the axes of the design."""
    axes = {
        **spec.get("grid", {}),
        **{name: spec[name] for name in ("steppers", "steps_per_frame") if spec.get(name)},
    }
    words = [f"{len(values)} {name}" for name, values in axes.items()]
    if spec.get("random"):
        drawn = ", ".join(spec["random"])
        words.append(f"{spec['count']} draws of {drawn} for each of {len(spec['seeds'])} seeds")
    fixed = [f"{name} {shown(value)}" for name, value in spec.get("fixed", {}).items()]
    # A problem in a user's file has a name only.
    problem = spec.get("problem") or spec["name"]
    return [f"Problem: {', '.join([problem, *fixed])}", f"Design: {' x '.join(words)}"]


def _results(stepper: StepperSummary) -> tuple[str, ...]:
    """The cells under `_STEPPER`, but for its name."""
    counts, ranges = stepper.counts, stepper.ranges
    errors = []
    if "error_max" in ranges:
        low, high = ranges["error_max"]
        errors.append(f"{low:.3e} to {high:.3e}")
    if unresolved := counts["resolved"][False]:
        errors.append(f"{unresolved} unresolved")
    orders = [f"{n} {verdict}" for verdict, n in counts["order_verdict"].most_common() if verdict]
    words = [", ".join(orders)] if orders else []
    if orders and "observed_order" in ranges:
        low, high = ranges["observed_order"]
        words.append(f"observed {low:.3f} to {high:.3f}")
    expected = [str(order or "none") for order in counts["expected_order"] if order is not None]
    if orders and expected:
        words.append(f"expected {' or '.join(sorted(expected))}")
    stable = "{:.4g} to {:.4g}".format(*ends) if (ends := ranges.get("largest_stable_dt")) else ""
    runs = ", ".join(f"{n} {status}" for status, n in counts["status"].most_common())
    return runs, "; ".join(errors), "; ".join(words), stable
