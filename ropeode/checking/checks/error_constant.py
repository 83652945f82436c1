"""The error of runs beside the one that follows from single steps."""

from __future__ import annotations

from typing import Any

from ropeode.analysis import AGREE
from ropeode.checking.check_context import Examination, reference_of
from ropeode.checking.report import Finding
from ropeode.norms import NORMS
from ropeode.study.error_constant import ErrorConstant, error_constant
from ropeode.theory import predicted_error

_ROPE = "unequal"


def predicted(examination: Examination) -> Finding:
    """The leading term of the error, predicted from the step, and measured."""
    check, problem = "error-constant", examination.problems[_ROPE]
    if refusal := examination.refusal(problem):
        return Finding(check, "skip", refusal)
    reference = reference_of(problem)
    prediction = predicted_error(reference, examination.method)
    if isinstance(prediction, str):
        return Finding(check, "skip", f"nothing is predicted: {prediction}")
    convergence, lines = examination.convergence(_ROPE), []
    evidence: dict[str, Any] = {"order": prediction.order}
    for name, each in convergence.quantities.items():
        errors = zip(each.errors, each.rounding, strict=True)
        runs = dict(zip(convergence.dts, errors, strict=True))
        found = error_constant(reference, NORMS[f"{name}-max"], runs, each.order, prediction)
        lines.append(f"{name} {_words(found)}")
        evidence[name] = {
            "predicted": found.predicted,
            "measured": found.measured,
            "ratio": found.ratio,
            "agree_10_percent": found.agree_from(AGREE),
        }
    return Finding(check, "note", "error predicted from the step: " + "; ".join(lines), evidence)


def _words(found: ErrorConstant) -> str:
    if found.predicted is None:
        return f"unknown, for {found.why}"
    term = f"{found.predicted:.4g} dt{f'^{found.order}' if found.order != 1 else ''}"
    if found.ratio is None:
        return f"{term}, and no run to measure it"
    words = f"{term}, measured {found.ratio:.4f} times that at dt = {found.dt:.3g}"
    if found.agree_from(AGREE) is None:
        closer = "and closer with each dt" if found.approaches else "and no closer with finer dt"
        words += f" ({closer})"
    return words
