"""Errors of single steps from many states, beside the exact motion.

Every method moves a short way along the solution, up to a small part of the way. How small depends
on the method and on how short the way is beside what changes fastest, but hardly on the state: a
state, a step size or a rope from which a step errs much more than from others shows a threshold.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ropeode.errors import UserCodeError
from ropeode.problems import Problem
from ropeode.simulation import Method
from ropeode.theory import StepSamples

# How long steps are beside the shortest time in which something changes.
LENGTHS = np.array([1e-5, 1e-3, 0.03])
# Errors of right steps from usual states differ by a factor of 5, whatever the method.
_MORE = 15.0
_USUAL = 12
# Steps of the classical Runge-Kutta method that stand for the exact motion.
_PARTS = 8
# Of such a motion, into how many a frame is divided.
_CHUNKS = 32
# What a solver that iterates up to an absolute tolerance may leave, as a part of the state.
_TOLERANCE = 1e-7


class LocalErrors(NamedTuple):
    """Errors of single steps, as parts of the way that a node goes meanwhile.

    Fields:
        dt: step sizes, ``(states, sizes)``.
        errors: of the node where they are largest, ``(states, sizes)``.
        left: what a tolerance may leave, in the same unit.
        node: which one that is.
    """

    dt: np.ndarray
    errors: np.ndarray
    left: np.ndarray
    node: np.ndarray

    def too_large(self, usual: np.ndarray) -> tuple[int, int] | None:
        """The state and the size with the first error that is much larger than others."""
        wrong = np.argwhere(~(self.errors <= _MORE * usual + self.left))
        return (int(wrong[0, 0]), int(wrong[0, 1])) if len(wrong) else None

    def words(self, state: int, size: int, usual: float) -> str:
        """An error beside the usual one."""
        error = self.errors[state, size]
        errs = f"errs by {error:.1e} of its way"
        if not np.isfinite(error):
            errs = "returns a number that is not finite (nan or infinite)"
        return (
            f"a step (dt = {self.dt[state, size]:.2g}) {errs}, most at node "
            f"{self.node[state, size]}, where {usual:.1e} is usual"
        )


def local_errors(problem: Problem, method: Method, y: np.ndarray, steps: np.ndarray) -> LocalErrors:
    """Those of single steps from several states of a rope without a drive.

    Arguments:
        problem: the rope.
        method: the stepper.
        y: states, ``(states, 2, nodes, dim)``.
        steps: how long the steps are beside the shortest time in which something changes,
            ``(sizes,)``.

    Raises:
        UserCodeError: the step raised.
    """
    args, fastest = problem.args, _fastest(y, problem.args)
    dt = steps / fastest[:, None]
    after = single_steps(problem, method, np.full(len(y), problem.ts[0]), y, dt)
    off = _longest(after - y[:, None] - _moved(y, args, dt))
    way = dt[:, :, None, None] * _speeds(y, args, fastest)[:, None]
    # A state in a unit of time in which the highest rate is one.
    units = np.stack([np.ones_like(fastest), fastest], axis=1)
    size = np.max(_longest(y) / units[:, :, None], axis=(1, 2))[:, None] * units
    left = _TOLERANCE * size[:, None, :, None] / way
    errors = np.where(np.isfinite(off), off, np.inf) / way
    flat = (*errors.shape[:2], -1)
    errors, left = errors.reshape(flat), left.reshape(flat)
    most = np.argmax(errors / (1.0 + left), axis=2)[..., None]
    errors, left = (np.take_along_axis(each, most, axis=2)[..., 0] for each in (errors, left))
    return LocalErrors(dt, errors, left, most[..., 0] % y.shape[2])


def single_steps(
    problem: Problem, method: Method, t: np.ndarray, y: np.ndarray, dt: np.ndarray
) -> np.ndarray:
    """The states after one step, ``(states, sizes, *state)``.

    Arguments:
        problem: that the steps are made on.
        method: the stepper.
        t: times, ``(states,)``.
        y: states, ``(states, *state)``.
        dt: step sizes for each, ``(states, sizes)``.

    Raises:
        UserCodeError: the step raised.
    """
    return StepSamples(problem, method).after(t, y, dt, 1)[:, :, 1]


def usual_errors(problem: Problem, method: Method) -> np.ndarray | None:
    """The errors of steps of `LENGTHS` from states as a rope comes to, ``(sizes,)``.

    None where a step from one of these does not move along the solution at all.
    """
    random = np.random.default_rng(0)
    size = np.array([0.1, 0.5])[:, None, None] * problem.args.free[:, None]
    states = problem.y0 + size * random.normal(size=(_USUAL, *problem.y0.shape))
    usual = np.median(local_errors(problem, method, states, LENGTHS).errors, axis=0)
    return usual if np.all(usual < 1.0) else None


def why_unknown(error: UserCodeError) -> str:
    """Why a step shows nothing where it raises: it may refuse what is far from usual.

    Raises:
        UserCodeError: it tried to end the process.
    """
    if isinstance(error.__cause__, SystemExit):
        raise error
    return error.problems[0].removeprefix("step: ").split("; allowed")[0]


def rates(y: np.ndarray, args: Any) -> np.ndarray:
    """The right-hand side of the rope, of many states ``(..., 2, nodes, dim)``."""
    x, v = y[..., 0, :, :], y[..., 1, :, :]
    d = np.diff(x, axis=-2)
    length = np.linalg.norm(d, axis=-1, keepdims=True)
    pull = args.stiffness[:, None] * (length - args.rest_length[:, None]) * d / length
    force = args.mass[:, None] * args.gravity - args.damping[:, None] * v
    force[..., :-1, :] += pull
    force[..., 1:, :] -= pull
    return np.stack([v, (args.free / args.mass)[:, None] * force], axis=-3)


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


def exact_states(problem: Problem) -> np.ndarray:
    """The states of a rope without a drive at its sample times, ``(times, *state)``."""
    states = [problem.y0]
    for span in np.diff(problem.ts):
        y = states[-1]
        for _ in range(_CHUNKS):
            dt = np.full((1, 1), span / _CHUNKS)
            y = y + _moved(y[None], problem.args, dt)[0, 0]
        states.append(y)
    return np.stack(states)


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
