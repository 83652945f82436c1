"""A sweep for a terminal of 80 columns."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ropeode.render.text_layout import hanging, wrapped
from ropeode.sweep.design.columns import STATUSES
from ropeode.sweep.storage.summary import StepperSummary, SweepSummary
from ropeode.validation import shown

_REASONS = 5
_LONGEST_REASON = 200


def as_text(summary: SweepSummary) -> str:
    """The spec, the progress, and a summary for each stepper."""
    lines = [
        *wrapped(f"Sweep in {summary.folder}: {summary.done} of {summary.total} cases"),
        *_design(summary.spec),
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
        for (status, reason), number in [*summary.reasons.items()][:_REASONS]:
            cut = reason if len(reason) <= _LONGEST_REASON else f"{reason[:_LONGEST_REASON]}..."
            lines += wrapped(f"{number} {status}: {cut}", 4)
        if (more := len(summary.reasons) - _REASONS) > 0:
            lines += wrapped(f"and {more} others", 4)
    return "\n".join([*lines, ""])


def _design(spec: Mapping[str, Any]) -> list[str]:
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
    lines = wrapped(f"Problem: {', '.join([problem, *fixed])}")
    return [*lines, *wrapped(f"Design: {' x '.join(words)}")]


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
