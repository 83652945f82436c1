"""Errors of single steps from many states, beside the exact motion.

Every method moves a short way along the solution, up to a small part of the way. How small depends
on the method and on how short the way is beside what changes fastest, but hardly on the state, and
not at all on the units: a state, a step size, a unit or a rope from which a step errs much more
than from others shows a threshold.
"""

from __future__ import annotations

import dataclasses
import functools
from typing import Any, NamedTuple

import numpy as np

from ropeode.checking.check_ropes import Units, rates
from ropeode.errors import UserCodeError
from ropeode.problems import Problem
from ropeode.simulation import Method
from ropeode.theory import StepSamples

# Steps of the classical Runge-Kutta method that stand for the exact motion.
_PARTS = 8
# What a solver that iterates up to an absolute tolerance may leave, as a part of the state. In
# units in which lengths or speeds are small numbers that is more, and rounding makes more of a
# derivative by finite differences where they are large numbers; but never as much as all.
_TOLERANCE, _MOST, _LARGE = 1e-7, 2e-3, 2.0**10

_USUAL_UNITS = Units()


@dataclasses.dataclass(frozen=True)
class Case:
    """States of a rope without a drive, in some units, at some place and time.

    Arguments:
        rope: in the usual units.
        states: of it, likewise, ``(states, 2, nodes, dim)``.
        units: in which the steps are made.
        away: how far from its usual place, in units of length, ``(dim,)``.
        later: how much later than the rope's start, in units of time.
        least: what errors are usual there at least, over the lengths of steps.
    """

    rope: Problem
    states: np.ndarray
    units: Units = _USUAL_UNITS
    away: Any = 0.0
    later: float = 0.0
    least: float = 0.0

    @property
    def moved(self) -> np.ndarray:
        """The states in the units, at the place, ``(states, 2, nodes, dim)``."""
        return self.states * self.units.state + self._shift

    @property
    def t(self) -> float:
        """The time in the units."""
        return float(self.rope.ts[0] + self.later) * self.units.time

    @property
    def _shift(self) -> np.ndarray:
        away = np.broadcast_to(self.away, self.states.shape[-1:])
        return self.units.length * np.stack([away, 0.0 * away])[:, None]

    @property
    def tolerance(self) -> float:
        """What a step may err by in any case, as a part of the state."""
        speed = self.units.length / self.units.time
        small, large = min(self.units.length, speed), max(self.units.length, speed)
        # A tolerance may be one for parts of the state.
        part = max(1.0, float(np.max(np.abs(self.away))))
        return min(max(part, 1.0 / small, large / _LARGE) * _TOLERANCE, _MOST)

    def after(self, method: Method, dt: np.ndarray, steps: int) -> np.ndarray:
        """The states after a step, in the usual units, ``(states, sizes, 2, nodes, dim)``.

        Arguments:
            method: the stepper.
            dt: step sizes for each state, in the usual units, ``(states, sizes)``.
            steps: after how many steps.

        Raises:
            UserCodeError: the step raised.
        """
        samples = StepSamples(self.units.of(self.rope), method)
        t = np.full(len(self.states), self.t)
        states = samples.after(t, self.moved, dt * self.units.time, steps)[:, :, steps]
        return (states - self._shift) / self.units.state


class LocalErrors(NamedTuple):
    """Errors of single steps, as parts of the way that a node goes meanwhile.

    Fields:
        dt: step sizes in the usual units, ``(states, sizes)``.
        errors: of the node where they are largest, ``(states, sizes)``.
        left: what a tolerance may leave, in the same unit.
        node: which one that is.
    """

    dt: np.ndarray
    errors: np.ndarray
    left: np.ndarray
    node: np.ndarray


def local_errors(case: Case, method: Method, lengths: np.ndarray) -> LocalErrors:
    """Those of single steps from the states of a case.

    Arguments:
        case: the states.
        method: the stepper.
        lengths: how long the steps are beside the shortest time in which something changes,
            ``(sizes,)``.

    Raises:
        UserCodeError: the step raised.
    """
    y, steps = case.states, _steps(case.rope, method)
    exact = _exact(case.rope, y.tobytes(), tuple(lengths.tolist()), steps)
    off = _longest(case.after(method, exact.dt, steps) - y[:, None] - exact.moved)
    left = case.tolerance * exact.size[:, None, :, None] / exact.way
    errors = np.where(np.isfinite(off), off, np.inf) / exact.way
    flat = (*errors.shape[:2], -1)
    errors, left = errors.reshape(flat), left.reshape(flat)
    most = np.argmax(errors / (1.0 + left), axis=2)[..., None]
    errors, left = (np.take_along_axis(each, most, axis=2)[..., 0] for each in (errors, left))
    return LocalErrors(exact.dt, errors, left, most[..., 0] % y.shape[2])


def why_unknown(error: UserCodeError) -> str:
    """Why a step shows nothing where it raises: it may refuse what is far from usual.

    Raises:
        UserCodeError: it tried to end the process.
    """
    if isinstance(error.__cause__, SystemExit):
        raise error
    return error.problems[0].removeprefix("step: ").split("; allowed")[0]


def _steps(rope: Problem, method: Method) -> int:
    """How many steps are made: two if the first may be one of another kind."""
    return 2 if StepSamples(rope, method).may_begin else 1


class _Exact(NamedTuple):
    """What is exact of some steps, in the usual units.

    Fields:
        dt: step sizes, ``(states, sizes)``.
        moved: how far the solution moves, ``(states, sizes, 2, nodes, dim)``.
        way: how far each node might go, ``(states, sizes, 2, nodes)``.
        size: of the state, in a unit of time in which the highest rate is one, ``(states, 2)``.
    """

    dt: np.ndarray
    moved: np.ndarray
    way: np.ndarray
    size: np.ndarray


@functools.lru_cache(maxsize=4)
def _exact(rope: Problem, states: bytes, lengths: tuple[float, ...], steps: int) -> _Exact:
    """The same in all units, and so computed once for all of them."""
    y, args = np.frombuffer(states).reshape(-1, *rope.y0.shape), rope.args
    fastest = _fastest(y, args)
    dt = np.array(lengths) / fastest[:, None]
    way = steps * dt[:, :, None, None] * _speeds(y, args, fastest)[:, None]
    units = np.stack([np.ones_like(fastest), fastest], axis=1)
    size = np.max(_longest(y) / units[:, :, None], axis=(1, 2))[:, None] * units
    return _Exact(dt, _moved(y, args, steps * dt), way, size)


def _moved(y: np.ndarray, args: Any, dt: np.ndarray) -> np.ndarray:
    """How far the solution moves, ``(states, sizes, 2, nodes, dim)``."""
    h = dt[..., None, None, None] / _PARTS
    moved = np.zeros((*dt.shape, *y.shape[1:]))
    for _ in range(_PARTS):
        start = y[:, None] + moved
        k1 = rates(start, args)
        k2 = rates(start + h / 2 * k1, args)
        k3 = rates(start + h / 2 * k2, args)
        k4 = rates(start + h * k3, args)
        moved = moved + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return moved


def _longest(states: np.ndarray) -> np.ndarray:
    """The largest component of each vector, without the last axis."""
    return np.max(np.abs(states), axis=-1)


def _speeds(y: np.ndarray, args: Any, fastest: np.ndarray) -> np.ndarray:
    """How fast each node's position and velocity change, and might soon, ``(states, 2, nodes)``.

    For a pinned node it is what the fastest one's do.
    """
    speed, pull = np.moveaxis(_longest(rates(y, args)), 1, 0)
    stiffness = _stiffness(y, args) / fastest[:, None] ** 2
    first, last = ((0, 0), (0, 1)), ((0, 0), (1, 0))

    def by_springs(speed: np.ndarray) -> np.ndarray:
        either = np.maximum(speed[:, 1:], speed[:, :-1]) * stiffness
        return np.maximum(np.pad(either, first), np.pad(either, last)) / args.mass

    own = np.maximum(speed, pull / fastest[:, None])
    near = by_springs(own)
    near = np.maximum(near, by_springs(near))
    soon = np.maximum(pull, near * fastest[:, None])
    every = np.stack([np.maximum(own, near), soon], axis=1)
    return np.where(args.free > 0.0, every, np.max(every, axis=2, keepdims=True))


def _stiffness(y: np.ndarray, args: Any) -> np.ndarray:
    """That of each spring, the larger one of along and across it, ``(states, springs)``."""
    length = np.linalg.norm(np.diff(y[:, 0], axis=1), axis=2)
    return args.stiffness * np.maximum(1.0, args.rest_length / length)


def _fastest(y: np.ndarray, args: Any) -> np.ndarray:
    """The highest rate at which anything changes at each state, at least about, ``(states,)``."""
    length = np.linalg.norm(np.diff(y[:, 0], axis=1), axis=2)
    apart = np.linalg.norm(np.diff(y[:, 1], axis=1), axis=2)
    swings = np.sqrt(4.0 * np.max(_stiffness(y, args), axis=1) / np.min(args.mass))
    return np.maximum.reduce(
        [swings, np.max(apart / length, axis=1), 0 * swings + np.max(args.damping / args.mass)]
    )
