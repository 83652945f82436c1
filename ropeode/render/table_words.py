"""The words and cells of an accuracy table, in every format but JSON and CSV."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np

from ropeode.analysis import ObservedOrder
from ropeode.problems import Problem, rope_of
from ropeode.references import Certificate, remarks
from ropeode.study import AccuracyTable, Row, StepperOrder
from ropeode.study.error_constant import AGREE_CLOSELY, ErrorConstant
from ropeode.validation import counted

if TYPE_CHECKING:
    from ropeode.study import WorkPrecision

RUN_HEADERS = (
    "steps/frame",
    "dt",
    "max error",
    "final error",
    "rms error",
    "RHS evals",
    "seconds",
)
ORDER_HEADERS = ("stepper", "expected", "observed", "95% interval", "steps used", "verdict")


def title(table: AccuracyTable) -> str:
    """The title of the table."""
    return f"Accuracy of steppers: {problem_words(table.problem)}"


def problem_words(problem: Problem) -> str:
    """The problem in a few words."""
    words, parameters = [problem.name], problem.parameters
    rope = rope_of(problem)
    if rope is not None:
        words.append(counted(parameters["num_nodes"], "node"))
        words.append(_parameter_words("damping", parameters["damping"]))
    words.append(counted(problem.frames, "frame"))
    if rope is not None:
        usual = rope().model_dump(mode="json")
        words += [
            _parameter_words(name, parameters[name])
            for name in usual
            if name not in ("num_nodes", "damping") and parameters[name] != usual[name]
        ]
    return ", ".join(words)


def _parameter_words(name: str, value: Any) -> str:
    """A parameter with its value, or with a word for many values."""
    words = name.replace("_", " ")
    if isinstance(value, float):
        return f"{words} {value:g}"
    return f"{words} {json.dumps(value)}" if len(value) <= 3 else f"{words} of each its own"


def error_words(table: AccuracyTable | WorkPrecision) -> str:
    """Which error the table has."""
    last = table.reference.trusted - 1
    return f"Error: {table.norm.words}, over samples 1 to {last}."


def run_cells(row: Row, digits: int = 3) -> tuple[str, ...]:
    """One run as the cells under `RUN_HEADERS`, errors with so many digits behind the point."""
    if row.status != "ok":
        errors = (row.status, f"frame {row.diverged_at}", "")
    else:
        errors = tuple(
            error_cell(error, row.resolution, digits)
            for error in (row.error_max, row.error_final, row.error_rms)
        )
    seconds = f"{row.seconds:.2g}" if row.seconds < 10 else f"{row.seconds:.0f}"
    return (
        str(row.steps_per_frame),
        f"{row.dt:.4g}",
        *errors,
        str(row.rhs_evaluations or "-"),
        "-" if np.isnan(row.seconds) else seconds,
    )


def error_cell(error: float | None, resolution: float, digits: int = 3) -> str:
    """An error; where the reference does not resolve it, what it is below."""
    return f"< {resolution:.1e}" if error is None else f"{error:.{digits}e}"


def order_cells(table: AccuracyTable, each: StepperOrder) -> tuple[str, ...]:
    """The order of one stepper as the cells under `ORDER_HEADERS`."""
    order = each.order
    used = [steps for dt, steps in _steps_by_dt(table, each).items() if dt in order.used]
    return (
        each.stepper,
        "-" if each.expected is None else str(each.expected or "none"),
        "-" if order.observed is None else f"{order.observed:.3f}",
        order_interval(order),
        f"{min(used)} to {max(used)}" if used else "-",
        order.verdict,
    )


def observed_words(order: ObservedOrder, digits: int = 3) -> str:
    """The order that was observed, or why there is none."""
    if order.observed is None or order.verdict != "converges":
        return order.verdict
    return f"{order.observed:.{digits}f}"


def order_interval(order: ObservedOrder) -> str:
    """The 95% interval."""
    if order.ci95 is None:
        return "-"
    return f"[{order.ci95[0]:.3f}, {order.ci95[1]:.3f}]"


def constant_words(table: AccuracyTable, each: StepperOrder) -> str | None:
    """The leading term of the error by theory, and how far the runs are from it."""
    constant = each.constant
    if constant is None:
        return None
    if constant.predicted is None:
        return f"no error is predicted: {constant.why}"
    words = f"predicted error {leading_term(constant)}"
    if constant.ratio is None:
        return f"{words}; no run can be held against it"
    where = steps_at(table, each.stepper, constant.dt)
    words += f", measured {constant.ratio:.4f} times that at {where} steps/frame"
    first = constant.agree_10_percent
    if first is None:
        return f"{words}: {unlike_words(constant)}"
    if abs(constant.ratio - 1.0) > AGREE_CLOSELY:
        words += f"; within 10% from {steps_at(table, each.stepper, first)} steps/frame on"
    return words


def leading_term(constant: ErrorConstant) -> str:
    """The predicted error as a formula."""
    power = "dt" if constant.order == 1 else f"dt^{constant.order}"
    return f"{constant.predicted:.4g} {power}"


def unlike_words(constant: ErrorConstant) -> str:
    """What it means that the finest step size does not show the leading term to 10%."""
    if constant.approaches:
        return "pre-asymptotic, for finer steps come closer to the prediction"
    if len(constant.ratios) == 1:
        return "finer steps would tell whether they come closer to the prediction"
    return "theory and runs disagree, for finer steps come no closer to the prediction"


def steps_at(table: AccuracyTable, stepper: str, dt: float | None) -> str:
    """The steps per frame of a stepper's run with a step size."""
    found = (row for row in table.rows if row.stepper == stepper and row.dt == dt)
    return next((str(row.steps_per_frame) for row in found), "-")


def left_out_words(table: AccuracyTable, each: StepperOrder) -> str:
    """The steps per frame that were left out, by reason."""
    steps = _steps_by_dt(table, each)
    by_reason: dict[str, list[str]] = {}
    for point in each.order.left_out:
        by_reason.setdefault(point.reason, []).append(str(steps[point.dt]))
    return "; ".join(f"{reason}: {', '.join(words)}" for reason, words in by_reason.items())


def order_remark(order: StepperOrder) -> str | None:
    """A warning about a stepper that solves another problem."""
    if order.solves:
        return None
    return "keeps every link at its length: solves the inextensible rope, not this one"


def reference_words(table: AccuracyTable | WorkPrecision) -> str:
    """The reference and its bound, in the quantity of the errors."""
    reference, quantity = table.reference, table.norm.quantity
    certificate = reference.certificate
    others = ("independent", "more digits", "fewer digits")
    independent = [w for w in certificate.witnesses if w.role in others]
    inside = slice(reference.trusted)
    agreeing = ", ".join(
        f"{w.solver} {_agreement(table, w.differences[quantity][inside])}" for w in independent
    )
    drift = certificate.drift.get(quantity)
    kept = "" if drift is None else f"; constraints kept to {np.max(drift[inside]):.1e}"
    return (
        f"Reference: {certificate.solver} at rtol {certificate.rtol:.0e}, estimated bound "
        f"{reference.bound(table.norm)[-1]:.1e}; {agreeing}{kept}; {trust_words(certificate)}."
        + "".join(f" {remark}" for remark in remarks(reference))
    )


def trust_words(certificate: Certificate) -> str:
    """Up to where a reference is trusted, and why no further."""
    if certificate.horizon is None:
        return "trusted to the end"
    return f"trusted before t = {certificate.horizon:g} only ({certificate.horizon_reason})"


def _agreement(table: AccuracyTable | WorkPrecision, differences: np.ndarray) -> str:
    """How closely a witness agrees, and up to where if it has a horizon of its own."""
    reached = int(np.argmin(np.append(np.isfinite(differences), False)))
    words = f"agrees to {np.max(differences[:reached]):.1e}"
    if reached == len(differences):
        return words
    return f"{words} before t = {table.problem.ts[reached]:g}"


def _steps_by_dt(table: AccuracyTable, each: StepperOrder) -> dict[float, int]:
    return {row.dt: row.steps_per_frame for row in table.rows if row.stepper == each.stepper}
