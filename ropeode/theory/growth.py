"""Whether a problem hangs still under a stepper: the eigenvalues of its one-step map."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import numpy as np
from jax.flatten_util import ravel_pytree
from numpy.typing import ArrayLike
from scipy import linalg

from ropeode.analysis import hanging_equilibrium
from ropeode.arrays import real_array
from ropeode.json_form import Unbounded
from ropeode.precision import in_float64
from ropeode.problems import Problem, free_coordinates, require_problem
from ropeode.simulation import StepMap, method_of, step_size
from ropeode.validation import bad_value, check_whole

# No more steps per frame than this are tried.
MOST_STEPS_OF_GROWTH = 2**24
_EPS = float(np.finfo(np.float64).eps)
# The relative error of a derivative by differences, in place of a rounding.
_DIFFERENCE = 1e-11
# How many roundings an entry of the map's matrix may hold, and how many of the largest
# eigenvalue the method that finds eigenvalues may add.
_ROUNDINGS, _EIG_ROUNDINGS = 4.0, 16.0
# How many roundings of the largest term a step may move by where it stands still.
_STILL_ROUNDINGS = 64.0
_MOST_CORRECTIONS = 20
# Of a step size: how closely a limit is found.
_PRECISION = 1e-6
# Of a frame: a step with which nothing blows up while a stepper begins.
_SHORT = 2.0**-10


@dataclasses.dataclass(frozen=True)
class Growth:
    """How a small disturbance of an equilibrium grows or decays under a stepper.

    Arguments:
        steps_per_frame: n.
        radius: the spectral radius rho of one step: the largest factor by which a mode
            grows.
        per_frame: ``rho**n``.
        rate: ``n log(rho)``, per frame; below zero where every disturbance decays.
        tolerance: how far rounding may have moved `rate`.
        frequency: of the fastest growing mode, as the stepper makes it, in radians per time
            unit; not above pi/dt, which stands for a mode that changes sign at each step.
        predicted_blow_up: the frame by which a disturbance of one rounding (2^-53 of a
            length) has grown to that length at this rate; None if it does not grow.
    """

    steps_per_frame: int
    radius: float
    per_frame: float
    rate: float
    tolerance: float
    frequency: float
    predicted_blow_up: int | None

    @property
    def stable(self) -> bool:
        """Whether nothing grows faster than rounding could explain."""
        return self.rate <= self.tolerance


@in_float64
def growth_per_frame(
    problem: Problem, stepper: Any, steps_per_frame: int, y: ArrayLike | None = None
) -> Growth:
    """The growth of small disturbances, from the stepper's own step.

    ``stepper.step`` is differentiated with respect to all that it carries, held coordinates
    left out, and the eigenvalues of this matrix M are the factors by which modes grow in one
    step (von Neumann's criterion; Hairer, Wanner, Solving Ordinary Differential Equations
    II, section IV.2). They are computed as those of ``(M - 1)/dt``, which keeps the digits in
    which a factor of 1 + 1e-9 differs from 1.

    Rounding the entries of M moves an eigenvalue by at most ``|u| |M| |w|/|u w|`` roundings,
    to first order, with its left and right eigenvectors u and w (Wilkinson, The Algebraic
    Eigenvalue Problem, chapter 2). Of all modes, the one is reported that grows fastest after
    this has been taken off.

    Arguments:
        problem: a mechanical problem.
        stepper: whatever `ropeode.as_stepper` takes.
        steps_per_frame: of equal size.
        y: a state to linearise at, as it is. By default `hanging_equilibrium`, moved to
            where this stepper stands still: with `constraint-verlet` links hang a little
            longer than they are.

    Raises:
        InputError: the stepper cannot run on this problem, `steps_per_frame` is not a whole
            number >= 1, or there is no equilibrium.

    Examples:
        >>> from ropeode import Rope, growth_per_frame
        >>> growth = growth_per_frame(Rope(num_nodes=4).problem(frames=3), "explicit-euler", 64)
        >>> round(growth.per_frame, 2), growth.predicted_blow_up
        (11.43, 16)
    """
    steps = check_whole("steps_per_frame", steps_per_frame, at_least=1, example="64")
    return LinearisedStep(problem, stepper, y).growth(steps)


@in_float64
def stability_limit(problem: Problem, stepper: Any, y: ArrayLike | None = None) -> int | None:
    """The smallest number of steps per frame from which on the stepper is stable.

    `fewest_steps` says how it is searched for. Near the limit of a stepper that needs many
    steps the growth is lost in rounding, so that the number can come out too
    small: by less than 1 up to half a million steps per frame on the default rope.

    Arguments:
        problem: a mechanical problem.
        stepper: whatever `ropeode.as_stepper` takes.
        y: as for `growth_per_frame`.

    Returns:
        Steps per frame; None where `MOST_STEPS` are not enough.

    Raises:
        InputError: the stepper cannot run on this problem, or there is no equilibrium.

    Examples:
        >>> from ropeode import Rope, stability_limit
        >>> rope = Rope(num_nodes=4).problem(frames=3)
        >>> stability_limit(rope, "rk4"), stability_limit(rope, "semi-implicit-euler")
        (7, 10)
    """
    linearised = LinearisedStep(problem, stepper, y)
    return fewest_steps(lambda steps: linearised.growth(steps).stable)


def fewest_steps(stable: Callable[[int], bool], most: int = MOST_STEPS_OF_GROWTH) -> int | None:
    """The smallest number of steps per frame from which on a stepper is stable.

    The search doubles and halves, and tries twice and four times the result as well: where
    the stepper is unstable there, the search goes on from there.

    Arguments:
        stable: whether it is, with so many steps per frame.
        most: how many are tried.

    Returns:
        Steps per frame; None where `most` are not enough.
    """
    failed = 0
    while True:
        enough = max(1, 2 * failed)
        while not stable(enough):
            failed, enough = enough, 2 * enough
            if enough > most:
                return None
        while enough - failed > 1:
            middle = (enough + failed) // 2
            if stable(middle):
                enough = middle
            else:
                failed = middle
        again = [n for n in (2 * enough, 4 * enough) if not stable(n)]
        if not again:
            return enough
        failed = again[-1]


@dataclasses.dataclass(frozen=True)
class StableSteps:
    """How short steps have to be.

    Arguments:
        steps_per_frame: the smallest number from which on nothing grows; None where the largest
            that was tried is not enough.
        dt: the end of the interval of stable step sizes that they are in; 0 where there is none,
            infinite where no end was found.
    """

    steps_per_frame: int | None
    dt: Unbounded


@in_float64
def stable_steps_at_rest(problem: Problem, stepper: Any) -> StableSteps:
    """How short steps have to be for the equilibrium to be stable, by the stepper's own growth.

    Arguments and exceptions are those of `stability_limit`.
    """
    linearised = LinearisedStep(problem, stepper)
    return stable_steps(lambda steps: linearised.growth(steps).stable, linearised.frame)


def stable_steps(stable: Callable[[float], bool], frame: float) -> StableSteps:
    """Both limits: as a number of steps per frame, and by bisection as a step size.

    Arguments:
        stable: whether it is, with so many steps per frame, which need be no whole number.
        frame: the length of a frame.
    """
    steps = fewest_steps(stable)
    if steps is None:
        return StableSteps(None, 0.0)
    low, high = frame / steps, 2.0 * frame / steps
    while stable(frame / high):
        low, high = high, 2.0 * high
        if high > MOST_STEPS_OF_GROWTH * frame / steps:
            return StableSteps(steps, math.inf)
    return StableSteps(steps, bisected(lambda dt: stable(frame / dt), low, high, _PRECISION))


def bisected(stable: Callable[[float], bool], low: float, high: float, precision: float) -> float:
    """The end of what is stable, between a value that is and a higher one that is not.

    Arguments:
        stable: whether a value is.
        low, high: the two.
        precision: how far the end may be off, as a part of it.
    """
    while high - low > precision * high:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if stable(middle) else (low, middle)
    return float(low)


class LinearisedStep:
    """The derivative of a stepper's step about an equilibrium, for steps of any size.

    Arguments:
        problem, stepper, y: as for `growth_per_frame`.

    Attributes:
        frame: the length of a frame.
        settles: whether all steps after the first 16 are the same.

    Raises:
        InputError: as for `growth_per_frame`.
    """

    def __init__(self, problem: Problem, stepper: Any, y: ArrayLike | None = None):
        require_problem(problem)
        problem.require_equations()
        problem.require_mechanics("problem")
        method = method_of(stepper, problem)
        self._problem = problem
        self._name = method.stepper.label
        self._stands_still = y is None
        self._y = hanging_equilibrium(problem) if y is None else real_array("y", y)
        self._map = StepMap(problem, method)
        self._rounding = _EPS if self._map.exact else _DIFFERENCE
        self._free = free_coordinates(problem)
        self.frame = step_size(problem, 1)
        begin = self._map.beginning(self._y, _SHORT * self.frame, self._free)
        self.settles = begin is not None
        if self._stands_still and not self.settles:
            raise bad_value(
                "stepper",
                self._name,
                "one that has settled after 16 steps: each step of this one is another",
                "choose another one",
            )
        # From a state that moves, no two steps are the same.
        self._begin = begin or 0

    def growth(self, steps: float) -> Growth:
        """The `Growth` at so many steps per frame, which need be no whole number."""
        dt = self.frame / steps
        matrix = self.matrix(dt)
        slope = (matrix - np.eye(len(matrix))) / dt
        decomposition: Any = linalg.eig(slope, left=True, right=True)
        eigenvalues, left, right = decomposition
        with np.errstate(divide="ignore", invalid="ignore"):
            # |1 + dt z|^2 - 1, which is -1 for what a step forgets at once.
            excess = dt * (2.0 * eigenvalues.real + dt * np.abs(eigenvalues) ** 2)
            rates = steps * 0.5 * np.log1p(np.maximum(excess, -1.0))
            across = np.abs(np.sum(left.conj() * right, axis=0))
            moved = np.sum(np.abs(left) * (np.abs(matrix) @ np.abs(right)), axis=0) / across
            apart = np.sum(np.abs(left) * np.abs(right), axis=0) / across
            largest = dt * np.max(np.abs(eigenvalues))
            tolerances = (
                steps * self._rounding * (_ROUNDINGS * moved + _EIG_ROUNDINGS * largest * apart)
            )
            fastest = int(np.argmax(np.nan_to_num(rates - tolerances, nan=-np.inf)))
        rate, tolerance = float(rates[fastest]), float(tolerances[fastest])
        return Growth(
            steps_per_frame=int(steps),
            radius=math.exp(rate / steps),
            per_frame=math.exp(rate) if rate < 700.0 else math.inf,
            rate=rate,
            tolerance=tolerance,
            frequency=float(np.abs(np.angle(1.0 + dt * eigenvalues[fastest])) / dt),
            predicted_blow_up=math.ceil(53.0 * math.log(2.0) / rate) if rate > tolerance else None,
        )

    def matrix(self, dt: float) -> np.ndarray:
        """The derivative of a step of this size, over what can move of what is carried."""
        carried = self._map.start(self._y, dt, self._begin)
        free = self._map.moving(carried, self._free)
        flattened, unravel = ravel_pytree(carried)
        flat: Any = np.asarray(flattened)
        if not self._stands_still:
            return self._map.derivative(carried, dt, free)
        for _ in range(_MOST_CORRECTIONS):
            carried = unravel(flat)
            moved = (np.asarray(ravel_pytree(self._map.step(carried, dt))[0]) - flat)[free]
            matrix = self._map.derivative(carried, dt, free)
            if not (np.all(np.isfinite(moved)) and np.all(np.isfinite(matrix))):
                break
            size = np.abs(flat[free])
            # Where it rests at zero, what is small is small beside the problem's own size.
            terms = np.max(np.abs(matrix) @ size + size) + self._problem.scale
            if np.max(np.abs(moved)) <= _STILL_ROUNDINGS * self._rounding * terms:
                return matrix
            flat = flat.copy()
            flat[free] -= np.linalg.lstsq(matrix - np.eye(len(matrix)), moved, rcond=None)[0]
        raise bad_value(
            "stepper",
            self._name,
            f"one that stands still near the equilibrium of {self._problem.name!r}",
            "choose another one, or give the state to linearise at as y",
        )
