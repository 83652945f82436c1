"""The rope, with other numbers, whose motion a stepper's runs tend to."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Mapping, Sequence

import numpy as np

from ropeode.checking.diagnosis.parameters import (
    PARAMETERS,
    can_change,
    dimension,
    places,
    units,
)
from ropeode.checking.richardson import Limit, limit_of
from ropeode.precision import in_float64
from ropeode.problems.problem import Problem

# Of the motion: what the fit's own solutions are good for.
_FLOOR = 1e-9
# The limit has to be known so well, of the motion, for a fit of it to say anything.
SETTLED = 3e-3
# A motion this much smaller than it should be has come to a standstill.
_STANDSTILL = 1e-2
# Every rope that can be had by changing the mass as well can be had without.
_ENOUGH = tuple(name for name in PARAMETERS if name != "mass")
# Of the uncertainty: how precisely a fit is solved.
_PRECISE = 1e-2
# In units of its spread: a change that is no accident.
_CERTAIN = 10.0
# Masses, as factors, that are still physical.
_SMALLEST_INVERSE_MASS = 0.01


@dataclasses.dataclass(frozen=True)
class Observed:
    """What a stepper's runs of a problem tend to.

    Arguments:
        problem: that was to be solved.
        states: ``(times, *state)``; not-a-number for quantities that are not known.
        uncertainty: of each number, of the same shape.
        orders: with which each quantity tends to its limit; None where dt plays no role.
    """

    problem: Problem
    states: np.ndarray
    uncertainty: np.ndarray
    orders: dict[str, int | None]

    @property
    def motion(self) -> dict[str, float]:
        """How far each known quantity moves from its first sample."""
        moved = np.abs(self.states - self.states[:1])
        return {
            name: float(np.max(part))
            for name in self.orders
            if np.all(np.isfinite(part := self.problem.quantity(name, moved)))
        }

    def stands_still(self, reference: np.ndarray) -> bool:
        """Whether its motion is next to nothing beside what it should be.

        Arguments:
            reference: the states that are right, ``(times, *state)``.
        """
        should = np.abs(reference - reference[:1])
        return any(
            size < _STANDSTILL * float(np.max(self.problem.quantity(name, should)))
            for name, size in self.motion.items()
            if name == "position"
        )


def observed(
    problem: Problem,
    runs: Sequence[tuple[float, np.ndarray]],
    quantities: Sequence[str],
    rounding: Mapping[str, float] | None = None,
) -> Observed | None:
    """What runs tend to.

    Arguments:
        problem: that was to be solved.
        runs: step size and states ``(times, *state)`` of each.
        quantities: of the problem, that the runs have.
        rounding: of each quantity's numbers, where these have fewer digits than float64.

    Returns:
        None where a quantity tends to nothing, or its limit is not known to 0.3% of
        the motion.
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
        if limit is None or not _settled(limit):
            return None
        states[:, half] = limit.values
        size = max(float(np.max(np.abs(limit.values - limit.values[:1]))), 1e-300)
        each = np.maximum(limit.uncertainty, _FLOOR * size)
        uncertainty[:, half] = each.reshape(-1, *(1,) * (limit.values.ndim - 1))
        orders[name] = limit.order
    return Observed(problem, states, uncertainty, orders)


def _settled(limit: Limit) -> bool:
    size = float(np.max(np.abs(limit.values - limit.values[:1])))
    return limit.order is None or float(limit.uncertainty[-1]) <= SETTLED * size


@dataclasses.dataclass(frozen=True)
class Fit:
    """A rope with some numbers changed, beside what was observed.

    Arguments:
        names: of the parameters that were free.
        changes: of all parameters, as `parameters.places` says.
        spread: how far each change may be from the true one, as far as the uncertainty of
            what was observed decides; 0 for those that were not free.
        misfit: the largest difference to what was observed, in units of its uncertainty.
    """

    names: tuple[str, ...]
    changes: np.ndarray
    spread: np.ndarray
    misfit: float

    @property
    def explains(self) -> bool:
        """Whether what is left is no more than the uncertainty."""
        return self.misfit <= 1.0


@in_float64
def fit(
    seen: Observed,
    names: Sequence[str],
    start: np.ndarray | None = None,
    *,
    near: bool = False,
) -> Fit:
    """Change some parameters so that the rope moves as was observed.

    The fit begins with the first samples alone, where the motion depends on the numbers
    almost linearly, and takes in the others from there; unless it begins near its end.

    Arguments:
        seen: what was observed.
        names: of the parameters that may be changed; none to see how far the rope as it is
            claimed to be is off.
        start: changes to begin with; by default none.
        near: whether these are near what will be found.
    """
    # Not above: it imports diffrax.
    from ropeode.checking.diagnosis.fit_program import fitted

    problem = seen.problem
    count = 2 * dimension(problem) + 4
    free = np.sum([can_change(problem, name) for name in names] or [np.zeros(count)], axis=0)
    precise = 1.0 / seen.uncertainty[1:].reshape(len(problem.ts) - 1, -1)
    # So that what is to be made small is of size 1 to begin with, which suits the solver.
    tightness = max(
        size * float(np.max(1.0 / problem.quantity(name, seen.uncertainty)))
        for name, size in seen.motion.items()
    )
    early = precise * (np.arange(len(precise)) < max(len(precise) // 3, 1))[:, None]
    changes = np.zeros(count) if start is None else start * free
    left, slopes = np.full(1, np.inf), np.zeros((1, count))
    for weights in (early, precise) if names and not near else (precise,):
        given = (problem.rhs, problem.y0, problem.args, problem.ts, units(problem), free, changes)
        target = np.nan_to_num(seen.states[1:]).reshape(weights.shape)
        changes, left, slopes = (
            np.array(each)
            for each in fitted(*given, target, weights / tightness, _PRECISE / tightness)
        )
    misfit = float(np.max(np.abs(left))) * tightness
    inverse_mass = 1.0 + changes[places(dimension(problem))["mass"]]
    if not np.all(np.isfinite(changes)) or np.any(inverse_mass < _SMALLEST_INVERSE_MASS):
        misfit = np.inf
    return Fit(tuple(names), changes, _spread(slopes * tightness, free), misfit)


def _spread(slopes: np.ndarray, free: np.ndarray) -> np.ndarray:
    """How far changes may be off if every difference is off by up to 1, all in the worst way."""
    spread = np.zeros(len(free))
    inside = free > 0
    if np.any(inside):
        inverse = np.linalg.pinv(np.nan_to_num(slopes[:, inside]))
        spread[inside] = np.sum(np.abs(inverse), axis=1)
    return spread


def explanations(seen: Observed) -> tuple[Fit, ...]:
    """The smallest sets of parameters whose change explains what was observed.

    Arguments:
        seen: what was observed.

    Returns:
        All fits with as few parameters as possible that leave no more than the uncertainty:
        several cannot be told apart. One without any where the rope is as claimed; none
        where no change of these parameters explains it.
    """
    as_claimed = fit(seen, ())
    if as_claimed.explains:
        return (as_claimed,)
    whole = _with_all(seen)
    if not whole.explains:
        return ()
    needed = _certainly_changed(seen.problem, whole)
    for size in range(1, len(_ENOUGH) + 1):
        fits = [
            fit(seen, names, whole.changes, near=True)
            for names in itertools.combinations(PARAMETERS, size)
            if needed <= {*names}
        ]
        if found := tuple(each for each in fits if each.explains):
            return found
    return ()


def _with_all(seen: Observed) -> Fit:
    """The fit with all parameters free, from where the springs pull or from where they push."""
    found = fit(seen, _ENOUGH)
    if not found.explains:
        start = np.zeros(len(found.changes))
        start[places(dimension(seen.problem))["stiffness"]] = -2.0
        found = min(found, fit(seen, _ENOUGH, start), key=lambda each: each.misfit)
    return found


def _certainly_changed(problem: Problem, whole: Fit) -> set[str]:
    """Parameters without which nothing is explained: no other can stand in for them."""
    certain = np.abs(whole.changes) > _CERTAIN * whole.spread
    return {
        name
        for name, place in places(dimension(problem)).items()
        if name in ("gravity", "rest_length", "velocity") and np.any(certain[place])
    }
