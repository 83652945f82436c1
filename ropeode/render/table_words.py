"""The words and cells of an accuracy table, in every format but JSON and CSV."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from ropeode.analysis.order import ObservedOrder
from ropeode.problems.library import ROPES
from ropeode.study.accuracy_table import AccuracyTable, Row, StepperOrder

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
    return f"Accuracy of steppers: {problem_words(table)}"


def problem_words(table: AccuracyTable) -> str:
    """The problem in a few words."""
    problem, parameters = table.problem, table.problem.parameters
    words = [problem.name]
    if parameters.get("kind") in ROPES:
        words.append(f"{parameters['num_nodes']} nodes")
        words.append(_parameter_words("damping", parameters["damping"]))
    words.append(f"{problem.frames} frames")
    if kind := ROPES.get(parameters.get("kind", "")):
        usual = kind().model_dump(mode="json")
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


def error_words(table: AccuracyTable) -> str:
    """Which error the table has."""
    last = table.reference.trusted - 1
    return f"Error: {table.norm.words}, over samples 1 to {last}."


def run_cells(row: Row) -> tuple[str, ...]:
    """One run as the cells under `RUN_HEADERS`."""
    if row.status == "diverged":
        errors = ("diverged", f"frame {row.diverged_at}", "")
    else:
        errors = tuple(
            f"< {row.resolution:.1e}" if error is None else f"{error:.3e}"
            for error in (row.error_max, row.error_final, row.error_rms)
        )
    return (
        str(row.steps_per_frame),
        f"{row.dt:.4g}",
        *errors,
        str(row.rhs_evaluations or "-"),
        f"{row.seconds:.2g}" if row.seconds < 10 else f"{row.seconds:.0f}",
    )


def order_cells(table: AccuracyTable, stepper: str) -> tuple[str, ...]:
    """The order of one stepper as the cells under `ORDER_HEADERS`."""
    row = next(each for each in table.orders if each.stepper == stepper)
    order = row.order
    return (
        stepper,
        "-" if row.expected is None else str(row.expected or "none"),
        "-" if order.observed is None else f"{order.observed:.3f}",
        interval(order),
        used_steps(table, stepper, order),
        order.verdict,
    )


def interval(order: ObservedOrder) -> str:
    """The 95% interval."""
    if order.ci95 is None:
        return "-"
    return f"[{order.ci95[0]:.3f}, {order.ci95[1]:.3f}]"


def used_steps(table: AccuracyTable, stepper: str, order: ObservedOrder) -> str:
    """The steps per frame that the fit used."""
    used = [row.steps_per_frame for row in _rows(table, stepper) if row.dt in order.used]
    return f"{min(used)} to {max(used)}" if used else "-"


def left_out_words(table: AccuracyTable, stepper: str, order: ObservedOrder) -> str:
    """The steps per frame that were left out, by reason."""
    steps = {row.dt: row.steps_per_frame for row in _rows(table, stepper)}
    by_reason: dict[str, list[str]] = {}
    for point in order.left_out:
        by_reason.setdefault(point.reason, []).append(str(steps[point.dt]))
    return "; ".join(f"{reason}: {', '.join(each)}" for reason, each in by_reason.items())


def remark(order: StepperOrder) -> str | None:
    """A warning about a stepper that solves another problem."""
    if order.solves:
        return None
    return "keeps every link at its length: solves the inextensible rope, not this one"


def reference_words(table: AccuracyTable) -> str:
    """The reference and its bound, in the quantity of the errors."""
    reference, quantity = table.reference, table.norm.quantity
    certificate = reference.certificate
    independent = [w for w in certificate.witnesses if w.role in ("independent", "fewer digits")]
    inside = slice(reference.trusted)
    agreeing = ", ".join(
        f"{w.solver} {_agreement(table, w.differences[quantity][inside])}" for w in independent
    )
    drift = certificate.drift.get(quantity)
    kept = "" if drift is None else f"; constraints kept to {np.max(drift[inside]):.1e}"
    trust = (
        "trusted to the end"
        if reference.horizon is None
        else f"trusted before t = {reference.horizon:g} only ({certificate.horizon_reason})"
    )
    return (
        f"Reference: {certificate.solver} at rtol {certificate.rtol:.0e}, estimated bound "
        f"{reference.bound(table.norm)[-1]:.1e}; {agreeing}{kept}; {trust}."
    )


def _agreement(table: AccuracyTable, differences: np.ndarray) -> str:
    """How closely a witness agrees, and up to where if it has a horizon of its own."""
    reached = int(np.argmin(np.append(np.isfinite(differences), False)))
    words = f"agrees to {np.max(differences[:reached]):.1e}"
    if reached == len(differences):
        return words
    return f"{words} before t = {table.problem.ts[reached]:g}"


def _rows(table: AccuracyTable, stepper: str) -> list[Row]:
    return [row for row in table.rows if row.stepper == stepper]
