"""Convergence of runs from files, whose round-off cannot be measured by a second run."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np

from ropeode.analysis.order import ROUND_OFF, UNRESOLVED, UNSTABLE, LeftOut, ObservedOrder
from ropeode.checking.convergence import convergence_finding, converging
from ropeode.checking.report import Convergence, Finding
from ropeode.checking.trajectories.initial_states import rounding_of
from ropeode.checking.trajectories.layout import states_of
from ropeode.checking.trajectories.run_files import Run
from ropeode.checking.written_precision import digits_of, epsilon, single_precision
from ropeode.errors import InputError
from ropeode.references.reference import Reference
from ropeode.validation import complaint

# Errors below 30 times the round-off are left out; for the largest possible round-off, three times
# are enough.
_SHARE = 0.1
# The smallest ratio of the largest step size to the smallest: if a thirtieth of each error is
# rounding, the slope then has an error of 0.16.
_SPAN = 1.5


def order_finding(
    reference: Reference, runs: Sequence[Run], expected: int | None
) -> tuple[Finding, tuple[str, ...]]:
    """The verdict on convergence, and notes on its evidence.

    The rounding of the written numbers is known, and errors of its size are left out. The
    round-off of the runs themselves is unknown. Only if the runs seem wrong, the step sizes are
    left out at which the largest possible round-off could be the reason.

    Raises:
        InputError: the runs show neither that the program is right nor that it is wrong; the
            message says what is needed.
    """

    def with_rounding(rounding: Callable[[Run], np.ndarray]) -> Convergence:
        return converging(
            reference,
            [
                (run.dt, run.states, states_of(run.problem, run.values + rounding(run)))
                for run in runs
            ],
            expected=expected,
            quantities=runs[0].quantities,
        )

    as_written = with_rounding(rounding_of)
    finding, notes = convergence_finding("order", as_written), ()
    if finding.status == "pass" and all(map(shown, as_written.orders.values())):
        return finding, notes
    careful = with_rounding(lambda run: worst_rounding(run, reference))
    finding = convergence_finding("order", careful)
    if finding.status == "pass" and all(map(shown, careful.orders.values())):
        notes = (
            "the finest step sizes are left out, because round-off could explain their errors",
        )
    elif not _is_refuted(careful):
        if not _finest_is_unstable(careful):
            raise InputError(_undecided(finding.line, careful, as_written, runs))
        line = f"{finding.line}; even the error of the finest run is twice the motion or more"
        finding = dataclasses.replace(finding, status="fail", line=line)
    return finding, notes


def worst_rounding(run: Run, reference: Reference) -> np.ndarray:
    """The largest possible rounding in each column, ``(columns,)``.

    That of the written digits, and a part of the round-off of the run: errors many times larger
    than the rounding are left out of an order.
    """
    return rounding_of(run) + _SHARE * _round_off(run, reference)


def _round_off(run: Run, reference: Reference) -> np.ndarray:
    """The largest round-off of a right program in each column, ``(columns,)``.

    It is that of the position form of Störmer and Verlet: each step rounds positions, and so
    velocities by as much over dt. These errors add up like a random walk, and are integrated.
    """
    problem = reference.problem
    positions = problem.quantity(problem.quantities[0], reference.states)
    unit = 0.5 * epsilon(run.values) * float(np.max(np.abs(positions), initial=problem.scale))
    span = float(problem.ts[-1] - problem.ts[0])
    of_rate = unit * np.sqrt(span / run.dt) / run.dt
    columns = np.full(run.values.shape[2], of_rate)
    columns[: run.layout.dim] *= span
    return columns


def _is_refuted(convergence: Convergence) -> bool:
    """Whether the quantities that do show an order are wrong."""
    known = {name: order for name, order in convergence.orders.items() if shown(order)}
    rest = dataclasses.replace(convergence, orders=known)
    return convergence_finding("order", rest).status == "fail"


def shown(order: ObservedOrder) -> bool:
    """Whether there is an order, over a sufficient range of step sizes."""
    return order.verdict != "undetermined" and order.used[0] >= _SPAN * order.used[-1]


def _finest_is_unstable(convergence: Convergence) -> bool:
    finest = LeftOut(convergence.dts[-1], UNSTABLE)
    return any(finest in order.left_out for order in convergence.orders.values())


def _undecided(
    line: str, careful: Convergence, as_written: Convergence, runs: Sequence[Run]
) -> str:
    """The complaint that the files show neither that the program is right nor that it is wrong."""
    finest = runs[-1].values
    if _lost(as_written, ROUND_OFF):
        given = f"numbers with {digits_of(finest)[0]} digits"
        fix = "write 17 digits, with std::setprecision(17) or %.17g"
    elif _lost(careful, ROUND_OFF) and single_precision(finest):
        given, fix = (
            "numbers in single precision",
            "compute in double precision, or use larger steps",
        )
    elif _lost(careful, ROUND_OFF) or _lost(careful, UNRESOLVED):
        given = "errors so small that round-off or the reference's bound may hide them"
        fix = "add runs with larger steps"
    else:
        given, fix = "step sizes that show no order", "add runs, each with half the step size"
    return complaint("files", given, f"runs that show an order ({line})", fix)


def _lost(convergence: Convergence, reason: str) -> bool:
    """Whether an order is undetermined and a step size was left out for this reason."""
    return any(
        point.reason == reason
        for order in convergence.orders.values()
        if order.verdict == "undetermined"
        for point in order.left_out
    )
