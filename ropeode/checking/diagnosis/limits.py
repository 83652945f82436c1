"""Runs with smaller and smaller steps, and the trajectory that they tend to."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np

from ropeode.checking.richardson import Limit, limit_of
from ropeode.problems import Problem
from ropeode.references import Reference

# The step size and the states ``(times, *state)`` of each run.
Runs = Sequence[tuple[float, np.ndarray]]

# The uncertainty is at least this part of the motion: the fit's own solutions are no better.
_FLOOR = 1e-9
# A fit says something only if the limit's uncertainty is at most this part of the motion.
_LARGEST_UNCERTAINTY = 3e-3
# A motion this much smaller than the right one counts as a standstill.
_STANDSTILL = 1e-2


@dataclasses.dataclass(frozen=True)
class ObservedLimit:
    """The trajectory that the runs of a problem tend to as dt goes to 0.

    Arguments:
        problem: the problem that the runs should solve.
        states: ``(times, *state)``; not-a-number in quantities that the runs lack.
        uncertainty: of each number, of the same shape.
        orders: the order with which each quantity tends to its limit; None where the runs do
            not depend on dt.
    """

    problem: Problem
    states: np.ndarray
    uncertainty: np.ndarray
    orders: dict[str, int | None]

    @property
    def motion(self) -> dict[str, float]:
        """How far each quantity that the runs have moves from its first sample."""
        moved = np.abs(self.states - self.states[:1])
        return {
            name: float(np.max(part))
            for name in self.orders
            if np.all(np.isfinite(part := self.problem.quantity(name, moved)))
        }

    def stands_still(self, reference: Reference) -> bool:
        """Whether positions hardly move, compared with how far they should."""
        right = np.abs(reference.states - reference.states[:1])
        return any(
            size < _STANDSTILL * float(np.max(self.problem.quantity(name, right)))
            for name, size in self.motion.items()
            if name == "position"
        )

    def misfit(self, states: np.ndarray, error: np.ndarray) -> float:
        """The largest difference to a motion, in units of the uncertainty of both.

        Arguments:
            states: ``(times, *state)`` of the motion.
            error: of each number after the first sample; broadcast to ``(times - 1, *state)``.

        Returns:
            At most 1 where the motion may be the limit.
        """
        apart, uncertain = np.abs(self.states - states)[1:], self.uncertainty[1:] + error
        return max(
            float(np.max(self.problem.quantity(name, apart / uncertain))) for name in self.motion
        )


def observe_limit(
    problem: Problem,
    runs: Runs,
    quantities: Sequence[str],
    rounding: Mapping[str, float] | None = None,
) -> ObservedLimit | None:
    """Extrapolate runs to dt = 0.

    Arguments:
        problem: the problem that the runs should solve.
        runs: step size and states of each.
        quantities: of the problem, that the runs have.
        rounding: error of each quantity's numbers, where they have fewer digits than float64.

    Returns:
        None if a quantity has no limit, or its uncertainty exceeds 0.3% of the motion.
    """
    states = np.full((len(problem.ts), *problem.y0.shape), np.nan)
    uncertainty = np.full(states.shape, np.inf)
    orders: dict[str, int | None] = {}
    for name in quantities:
        half = problem.quantities.index(name)
        limit = limit_of(
            [dt for dt, _ in runs],
            [run[:, half] for _, run in runs],
            (rounding or {}).get(name, 0.0),
        )
        if limit is None or not _is_certain(limit):
            return None
        states[:, half] = limit.values
        each = np.maximum(limit.uncertainty, _FLOOR * max(_motion(limit), 1e-300))
        uncertainty[:, half] = each.reshape(-1, *(1,) * (limit.values.ndim - 1))
        orders[name] = limit.order
    return ObservedLimit(problem, states, uncertainty, orders)


def _motion(limit: Limit) -> float:
    return float(np.max(np.abs(limit.values - limit.values[:1])))


def _is_certain(limit: Limit) -> bool:
    return limit.order is None or float(limit.uncertainty[-1]) <= _LARGEST_UNCERTAINTY * _motion(
        limit
    )
