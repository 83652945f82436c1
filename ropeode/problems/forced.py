"""A quantity that follows a periodic forcing: first order, and not autonomous."""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from ropeode.problems.parameters import library_problem
from ropeode.problems.picture import Picture
from ropeode.problems.problem import Problem
from ropeode.validation import Finite, Positive, WholePositive


class ForcedArgs(NamedTuple):
    """The numbers in the equation."""

    rate: Any
    frequency: Any


def _with_its_forcing(times: np.ndarray, states: np.ndarray, args: ForcedArgs) -> np.ndarray:
    """The forcing, and the value that follows it."""
    return np.stack([np.cos(args.frequency * times), states[:, 0]], axis=1)[:, None]


@library_problem(Picture("phase", _with_its_forcing, ("forcing", "value")))
def forced(
    frames: WholePositive = 20, rate: Positive = 1.0, frequency: Finite = 1.0, y0: Finite = 0.0
) -> Problem:
    """Relaxation towards an oscillating value, ``y' = -rate (y - cos(frequency t))``.

    The state has the shape (1,). The time unit is one frame. With a rate of 50 or more this
    is a well-known stiff problem.

    Arguments:
        frames: the problem is sampled at times 0, 1, ..., `frames`.
        rate: of relaxation, per frame.
        frequency: of the forcing, in radians per frame.
        y0: initial value.

    Raises:
        InputError: one line for each argument that cannot be used.

    Source: Hairer and Wanner, Solving Ordinary Differential Equations II, section IV.1,
    equation (1.1), after Curtiss and Hirschfelder (1952).
    """
    args = ForcedArgs(rate, frequency)
    return Problem(
        rhs,
        np.array([y0]),
        np.arange(frames + 1.0),
        args,
        name="forced",
        exact=functools.partial(_exact, args, y0),
    )


def rhs(t: Any, y: Any, args: ForcedArgs) -> Any:
    """The derivative of `y`."""
    return -args.rate * (y - jnp.cos(args.frequency * t))


def solution(t: Any, rate: Any, frequency: Any, y0: Any) -> np.ndarray:
    """The state at times since the start, ``(times,)``, in extended precision.

    Arguments:
        t: times, ``(times,)``.
        rate: greater than zero.
        frequency: of the forcing.
        y0: initial value.
    """
    t, rate, frequency, y0 = (
        np.asarray(value, dtype=np.longdouble) for value in (t, rate, frequency, y0)
    )
    fade, phase = np.exp(-rate * t), frequency * t
    pushed = rate * (np.cos(phase) - fade) + frequency * np.sin(phase)
    return y0 * fade + rate * pushed / (rate * rate + frequency * frequency)


def _exact(args: ForcedArgs, y0: float, ts: np.ndarray) -> np.ndarray:
    return solution(ts, *args, y0)[:, None].astype(np.float64)
