"""A sweep for a terminal of 80 columns, and as a page."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from ropeode.render.markup import Block, Grid, Heading, Paragraph, Section
from ropeode.render.text_layout import hanging, wrapped
from ropeode.sweep.design.columns import STATUSES
from ropeode.sweep.storage.summary import StepperSummary, SweepSummary
from ropeode.validation import shown

_REASONS = 5
_LONGEST_REASON = 200


def as_text(summary: SweepSummary) -> str:
    """The spec, the progress, and a summary for each stepper."""
    lines = [
        *wrapped(f"Sweep in {line(summary)}"),
        *(each for words in _design_words(summary.spec) for each in wrapped(words)),
        "",
        *(
            line
            for status, meaning in STATUSES.items()
            if (number := summary.statuses[status])
            for line in hanging(f"{status:12} {number:>10}  ", meaning)
        ),
    ]
    for name, stepper in summary.steppers.items():
        lines += ["", name, *(line for text in _results(stepper) for line in wrapped(text, 4))]
    if summary.reasons:
        lines += ["", "Most frequent reasons"]
        lines += [each for words in _reason_words(summary) for each in wrapped(words, 4)]
    return "\n".join([*lines, ""])


def line(summary: SweepSummary) -> str:
    """The folder and the progress."""
    return f"{summary.folder}: {summary.done} of {summary.total} cases"


def blocks(summary: SweepSummary) -> list[Block]:
    """The spec, the progress, and a section for each stepper."""
    rows = [
        (status, str(number), meaning)
        for status, meaning in STATUSES.items()
        if (number := summary.statuses[status])
    ]
    parts: list[Block] = [
        Heading(f"Sweep in {line(summary)}"),
        *(Paragraph(words) for words in _design_words(summary.spec)),
        Grid(("status", "cases", "meaning"), rows, left=frozenset({0, 2}), long=frozenset({2})),
    ]
    for name, stepper in summary.steppers.items():
        parts += [Section(name), *(Paragraph(words) for words in _results(stepper))]
    if summary.reasons:
        parts += [Section("Most frequent reasons"), *map(Paragraph, _reason_words(summary))]
    return parts


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


def _results(stepper: StepperSummary) -> list[str]:
    """One sentence on the runs, one on errors, one on orders, one on stability."""
    counts, ranges = stepper.counts, stepper.ranges
    sentences = [", ".join(f"{n} {status}" for status, n in counts["status"].most_common())]
    errors = []
    if "error_max" in ranges:
        low, high = ranges["error_max"]
        errors.append(f"{low:.3e} to {high:.3e}")
    if unresolved := counts["resolved"][False]:
        errors.append(f"{unresolved} unresolved")
    if errors:
        sentences.append(f"max error {'; '.join(errors)}")
    verdicts = {name: n for name, n in counts["order_verdict"].most_common() if name}
    if verdicts:
        words = ", ".join(f"{n} {verdict}" for verdict, n in verdicts.items())
        if "observed_order" in ranges:
            low, high = ranges["observed_order"]
            words += f"; observed {low:.3f} to {high:.3f}"
        expected = [str(order or "none") for order in counts["expected_order"] if order is not None]
        if expected:
            words += f"; expected {' or '.join(sorted(expected))}"
        sentences.append(f"order: {words}")
    if "largest_stable_dt" in ranges:
        low, high = ranges["largest_stable_dt"]
        sentences.append(f"largest stable dt {low:.4g} to {high:.4g}")
    return sentences
