"""Convergence of runs that were read from files, whose round-off nobody has measured."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np

from ropeode.analysis.order import ROUND_OFF, UNRESOLVED, ObservedOrder
from ropeode.errors import InputError
from ropeode.grading.convergence import convergence_finding, converging
from ropeode.grading.report import Convergence, Finding
from ropeode.grading.trajectories.digits import digits_of, epsilon, single_precision
from ropeode.grading.trajectories.initial import rounding_of
from ropeode.grading.trajectories.layout import Layout, states_of
from ropeode.grading.trajectories.runs import Run
from ropeode.references.reference import Reference
from ropeode.validation import complaint

# Errors are left out below 30 times what is taken for round-off; of the worst that is possible,
# three times are enough.
_SHARE = 0.1


def order_finding(
    reference: Reference, runs: Sequence[Run], expected: int | None
) -> tuple[Finding, tuple[str, ...]]:
    """The verdict on convergence, and notes on what it rests on.

    What the way of writing numbers has rounded off is known and left out. How much round-off
    the runs themselves have is not; so only where they seem to be wrong, the step sizes are
    left out at which the worst that is possible could be the reason.

    Arguments:
        reference: of the problem.
        runs: from coarse to fine.
        expected: the order that is claimed.

    Raises:
        InputError: the numbers cannot tell, since what was rounded off may hide the errors, or
            all errors are smaller than the reference can resolve.
    """
    problem, layout = reference.problem, Layout.of(reference.problem)
    quantities = problem.quantities[: runs[0].values.shape[2] // layout.dim]
    pairs = [(run.dt, states_of(problem, run.values)) for run in runs]

    def with_rounding(rounding: Callable[[Run], np.ndarray]) -> Convergence:
        doubles = [states_of(problem, run.values + rounding(run)) for run in runs]
        return converging(
            reference, pairs, expected=expected, doubles=doubles, quantities=quantities
        )

    def worst(run: Run) -> np.ndarray:
        return rounding_of(run, layout) + _SHARE * _round_off(run, reference, layout)

    as_written = with_rounding(lambda run: rounding_of(run, layout))
    finding, notes = convergence_finding("order", as_written), []
    if finding.status != "pass":
        careful = with_rounding(worst)
        finding = convergence_finding("order", careful)
        if finding.status == "pass":
            notes.append("the finest step sizes are left out: round-off could explain their errors")
        _check_can_be_told(finding, as_written, runs)
    if finding.status == "note" or _undetermined(finding):
        line = f"{finding.line}: convergence is not shown, finer steps would show it"
        finding = dataclasses.replace(finding, status="fail", line=line)
    return finding, tuple(notes)


def _round_off(run: Run, reference: Reference, layout: Layout) -> np.ndarray:
    """The worst round-off that a sound program has in each column, ``(columns,)``.

    That of Störmer and Verlet's position form: each step rounds positions, and so velocities
    by as much over dt; these errors add up as a random walk does, and are integrated.
    """
    problem = reference.problem
    positions = problem.quantity(problem.quantities[0], reference.states)
    unit = 0.5 * epsilon(run.values) * float(np.max(np.abs(positions), initial=problem.scale))
    span = float(problem.ts[-1] - problem.ts[0])
    of_rate = unit * np.sqrt(span / run.dt) / run.dt
    columns = np.full(run.values.shape[2], of_rate)
    columns[: layout.dim] *= span
    return columns


def _check_can_be_told(finding: Finding, as_written: Convergence, runs: Sequence[Run]) -> None:
    """Raises:
    InputError: nothing is known to be wrong, and too little is known to be right.
    """
    assert finding.convergence is not None
    open_ones = [order for order in finding.convergence.orders.values() if _hidden(order)]
    wrong = any(each.verdict == "does not converge" for each in finding.convergence.orders.values())
    if wrong or not open_ones:
        return
    why = f"digits enough to tell an order ({finding.line})"
    finest = runs[-1].values
    if any(_lost(order, ROUND_OFF) for order in as_written.orders.values()):
        given = f"numbers with {digits_of(finest)[0]} digits"
        fix = "write 17, as std::setprecision(17) and %.17g do"
    elif single_precision(finest):
        given, fix = "numbers in single precision", "compute in double, or take larger steps"
    else:
        why = f"errors that round-off or the reference's bound cannot hide ({finding.line})"
        given, fix = "errors that are too small", "add runs with larger steps"
    raise InputError(complaint("files", given, why, fix))


def _hidden(order: ObservedOrder) -> bool:
    lost = _lost(order, ROUND_OFF) or _lost(order, UNRESOLVED)
    return order.verdict == "undetermined" and lost


def _lost(order: ObservedOrder, reason: str) -> bool:
    return any(point.reason == reason for point in order.left_out)


def _undetermined(finding: Finding) -> bool:
    assert finding.convergence is not None
    orders = finding.convergence.orders.values()
    return any(order.verdict == "undetermined" for order in orders)
