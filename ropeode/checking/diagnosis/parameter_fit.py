"""The rope, with other parameters, whose motion a stepper's runs tend to."""

from __future__ import annotations

import dataclasses
import functools
import itertools
from collections.abc import Sequence

import numpy as np
from scipy import optimize

from ropeode.checking.diagnosis.limits import ObservedLimit
from ropeode.checking.diagnosis.parameters import (
    PARAMETERS,
    can_change,
    dimension,
    places,
    units,
)
from ropeode.checking.diagnosis.sensitivities import sensitivities
from ropeode.precision import in_float64
from ropeode.problems import Problem

# Every rope with another mass moves like one with other gravity, damping and stiffness.
_WITHOUT_MASS = tuple(name for name in PARAMETERS if name != "mass")
# How precisely a fit is solved, as a part of the limit's uncertainty.
_PRECISION = 1e-2
# A change of so many times its spread is no accident.
_CERTAIN = 10.0
# Of the solver of the least-squares problem: its steps, and how large the first may be. Neither
# of the two finds every change that the other finds.
_MOST_STEPS, _FIRST_CHANGES = 40, (0.03, 1.0)
# Without it a Jacobian of zeros would be divided by.
_EPS = float(np.finfo(np.float64).eps)
# Replaces a difference that is not finite: so large that the solver rejects the step.
_WORST = 1e6
# The smallest inverse of a factor of the mass that is physical.
_SMALLEST_INVERSE_MASS = 0.01


@dataclasses.dataclass(frozen=True)
class Fit:
    """A rope with some parameters changed so that it comes close to an observed limit.

    Arguments:
        names: of the parameters that could change.
        changes: of all parameters, ordered as `parameters.places` says.
        spread: how far each change may be from the true one, given the uncertainty of the
            limit; 0 for parameters that could not change.
        misfit: the largest difference to the limit, in units of its uncertainty.
    """

    names: tuple[str, ...]
    changes: np.ndarray
    spread: np.ndarray
    misfit: float

    @property
    def explains(self) -> bool:
        """Whether the differences are within the uncertainty."""
        return self.misfit <= 1.0


@in_float64
def fit_parameters(
    limit: ObservedLimit,
    names: Sequence[str],
    start: np.ndarray | None = None,
    *,
    near: bool = False,
    first: float = _FIRST_CHANGES[0],
) -> Fit:
    """Change some parameters so that the rope moves like an observed limit.

    The fit begins with the first samples alone, where the motion depends on the parameters
    almost linearly, and then takes all samples; with `near` it takes all of them at once.

    Arguments:
        limit: what the runs tend to.
        names: of the parameters that may change; none, to measure the misfit of the rope as
            it is claimed to be.
        start: changes to begin with; by default zero.
        near: whether these are close to the result.
        first: how large the first change of a fit from zero may be.
    """
    problem = limit.problem
    count = 2 * dimension(problem) + 4
    free = np.any([np.zeros(count), *(can_change(problem, name) for name in names)], axis=0)
    weights = 1.0 / limit.uncertainty[1:].reshape(len(problem.ts) - 1, -1)
    tightness = max(
        size * float(np.max(1.0 / problem.quantity(name, limit.uncertainty)))
        for name, size in limit.motion.items()
    )
    tolerance = _PRECISION / tightness
    target = np.nan_to_num(limit.states[1:]).reshape(weights.shape)
    rope = (problem.rhs, problem.y0, problem.args, problem.ts, units(problem))

    @functools.lru_cache(maxsize=1)
    def differences(free_changes: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray]:
        """From the limit, in units of its uncertainty; and their derivatives."""
        changes = np.zeros(count)
        changes[free] = free_changes
        states, slopes = map(np.asarray, sensitivities(*rope, changes, tolerance))
        slopes = np.where(np.isfinite(slopes), slopes, 0.0) * weights[..., None]
        residual = np.where(weights > 0, weights * (states - target), 0.0)
        residual = np.where(np.isfinite(residual), residual, _WORST * tightness)
        return residual, slopes[..., free]

    def fitted(samples: int, start: np.ndarray) -> np.ndarray:
        """Fit the first samples; the differences are scaled to size 1 at the start."""
        return optimize.least_squares(
            lambda x: differences(tuple(x))[0][:samples].ravel() / tightness,
            start,
            lambda x: differences(tuple(x))[1][:samples].reshape(-1, len(x)) / tightness,  # pyright: ignore
            x_scale=first,
            xtol=tolerance,
            ftol=tolerance,
            gtol=_EPS,
            max_nfev=_MOST_STEPS,
        ).x

    changes = (np.zeros(count) if start is None else start)[free]
    if names and not near:
        changes = fitted(max(len(weights) // 3, 1), changes)
    if names:
        changes = fitted(len(weights), changes)
    residual, slopes = differences(tuple(changes))
    inverse = np.linalg.pinv(slopes.reshape(residual.size, len(changes)))
    every, spread = np.zeros(count), np.zeros(count)
    # The error of each change if every difference is off by 1, in the worst combination.
    every[free], spread[free] = changes, np.sum(np.abs(inverse), axis=1)
    misfit = float(np.max(np.abs(residual)))
    inverse_mass = 1.0 + every[places(dimension(problem))["mass"]]
    if not np.all(np.isfinite(every)) or np.any(inverse_mass < _SMALLEST_INVERSE_MASS):
        misfit = np.inf
    return Fit(tuple(names), every, spread, misfit)


def smallest_fits(limit: ObservedLimit) -> tuple[Fit, ...]:
    """The smallest sets of parameters whose change explains an observed limit.

    Returns:
        All fits with the fewest parameters that are within the uncertainty: if there are
        several, the runs cannot decide between them. One fit without parameters if the rope is
        as claimed; none if no change of these parameters explains the limit.
    """
    unchanged = fit_parameters(limit, ())
    if unchanged.explains:
        return (unchanged,)
    whole = _fit_all(limit)
    if not whole.explains:
        return ()
    needed = _certainly_changed(limit.problem, whole)
    for size in range(1, len(_WITHOUT_MASS) + 1):
        fits = [
            fit_parameters(limit, names, whole.changes, near=True)
            for names in itertools.combinations(PARAMETERS, size)
            if needed <= {*names}
        ]
        if explaining := tuple(each for each in fits if each.explains):
            return explaining
    return ()


def _fit_all(limit: ObservedLimit) -> Fit:
    """Fit all parameters, from springs that pull or push, with a small or a large first change."""
    pull = np.zeros(2 * dimension(limit.problem) + 4)
    push = pull.copy()
    push[places(dimension(limit.problem))["stiffness"]] = -2.0
    fits = []
    for first, start in itertools.product(_FIRST_CHANGES, (pull, push)):
        fits.append(fit_parameters(limit, _WITHOUT_MASS, start, first=first))
        if fits[-1].explains:
            break
    return min(fits, key=lambda each: each.misfit)


def _certainly_changed(problem: Problem, whole: Fit) -> set[str]:
    """Parameters that every explanation needs, because no other can replace them."""
    certain = np.abs(whole.changes) > _CERTAIN * whole.spread
    return {
        name
        for name, place in places(dimension(problem)).items()
        if name in ("gravity", "rest_length", "velocity") and np.any(certain[place])
    }
