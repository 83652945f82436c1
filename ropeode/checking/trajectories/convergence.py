"""Convergence of runs that were read from files, whose round-off nobody has measured."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np

from ropeode.analysis.order import ROUND_OFF, UNRESOLVED, UNSTABLE, LeftOut, ObservedOrder
from ropeode.checking.convergence import convergence_finding, converging
from ropeode.checking.report import Convergence, Finding
from ropeode.checking.trajectories.initial_states import rounding_of
from ropeode.checking.trajectories.layout import Layout, states_of
from ropeode.checking.trajectories.run_files import Run, quantities_of
from ropeode.checking.written_precision import digits_of, epsilon, single_precision
from ropeode.errors import InputError
from ropeode.references.reference import Reference
from ropeode.validation import complaint

# Errors are left out below 30 times what is taken for round-off; of the worst that is possible,
# three times are enough.
_SHARE = 0.1
# From the largest to the smallest step size: where a thirtieth of each error may be rounding, the
# slope is then known to 0.16.
_SPAN = 1.5


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
        InputError: they show neither that the program is right nor that it is wrong; says what
            would.
    """
    problem, layout = reference.problem, Layout.of(reference.problem)
    quantities = quantities_of(problem, runs)
    pairs = [(run.dt, states_of(problem, run.values)) for run in runs]

    def with_rounding(rounding: Callable[[Run], np.ndarray]) -> Convergence:
        doubles = [states_of(problem, run.values + rounding(run)) for run in runs]
        return converging(
            reference, pairs, expected=expected, doubles=doubles, quantities=quantities
        )

    as_written = with_rounding(lambda run: rounding_of(run, layout))
    finding, notes = convergence_finding("order", as_written), ()
    if finding.status == "pass" and all(map(shown, as_written.orders.values())):
        return finding, notes
    careful = with_rounding(lambda run: worst_rounding(run, reference, layout))
    finding = convergence_finding("order", careful)
    if finding.status == "pass" and all(map(shown, careful.orders.values())):
        notes = ("the finest step sizes are left out: round-off could explain their errors",)
    elif not _refuted(careful):
        if not _blew_up(careful):
            raise InputError(_cannot_be_told(finding.line, careful, as_written, runs))
        line = f"{finding.line}; even the finest run is off by more than twice the motion"
        finding = dataclasses.replace(finding, status="fail", line=line)
    return finding, notes


def worst_rounding(run: Run, reference: Reference, layout: Layout) -> np.ndarray:
    """What rounding may have added to each column at worst, ``(columns,)``.

    That of the written digits, and a share of the round-off of the run, since what is left out
    of an order are errors of many times the rounding.
    """
    return rounding_of(run, layout) + _SHARE * _round_off(run, reference, layout)


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


def _refuted(found: Convergence) -> bool:
    """Whether something is known to be wrong: what is not shown aside."""
    known = {quantity: order for quantity, order in found.orders.items() if shown(order)}
    rest = dataclasses.replace(found, orders=known)
    return convergence_finding("order", rest).status == "fail"


def shown(order: ObservedOrder) -> bool:
    """Whether there is an order, over step sizes that are far enough apart."""
    return order.verdict != "undetermined" and order.used[0] >= _SPAN * order.used[-1]


def _blew_up(found: Convergence) -> bool:
    """Whether the run with the smallest steps did."""
    finest = LeftOut(found.dts[-1], UNSTABLE)
    return any(finest in order.left_out for order in found.orders.values())


def _cannot_be_told(
    line: str, found: Convergence, as_written: Convergence, runs: Sequence[Run]
) -> str:
    """The complaint that the files show neither that the program is right nor that it is wrong."""
    finest = runs[-1].values
    if _lost(as_written, ROUND_OFF):
        given = f"numbers with {digits_of(finest)[0]} digits"
        fix = "write 17, as std::setprecision(17) and %.17g do"
    elif _lost(found, ROUND_OFF) and single_precision(finest):
        given, fix = "numbers in single precision", "compute in double, or take larger steps"
    elif _lost(found, ROUND_OFF) or _lost(found, UNRESOLVED):
        given = "errors so small that round-off or the reference's bound may hide them"
        fix = "add runs with larger steps"
    else:
        given, fix = (
            "step sizes that show no order",
            "add runs, each with steps half as large",
        )
    return complaint("files", given, f"runs that show an order ({line})", fix)


def _lost(found: Convergence, reason: str) -> bool:
    """Whether a step size was left out for this reason, where that left too few."""
    return any(
        point.reason == reason
        for order in found.orders.values()
        if order.verdict == "undetermined"
        for point in order.left_out
    )
