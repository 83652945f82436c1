"""Robertson's reaction, whose rates are nine orders of magnitude apart."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np

from ropeode.problems.parameters import library_problem
from ropeode.problems.picture import Picture
from ropeode.problems.problem import Problem
from ropeode.validation import Positive, WholePositive


def _scaled(times: np.ndarray, states: np.ndarray, args: Any) -> np.ndarray:
    """The first substance, and the second, of which there is never much more than 1e-5."""
    del times, args
    return (states[:, [0, 1]] * [1.0, 1e5])[:, None]


@library_problem(Picture("phase", _scaled, ("y1", "1e5 y2")))
def robertson(frames: WholePositive = 12, duration: Positive = 1e11) -> Problem:
    """Three substances; the second decays almost as soon as it forms.

    ``y1' = -0.04 y1 + 1e4 y2 y3``, ``y3' = 3e7 y2^2``, and the sum stays 1. The state has the
    shape (3,). Each frame but the first ends at ten times the time at which the one before
    ended.

    Arguments:
        frames: number of intervals between sample times.
        duration: time at which the last one ends.

    Raises:
        InputError: one line for each argument that cannot be used.

    Source: Hairer and Wanner, Solving Ordinary Differential Equations II, section IV.1,
    equation (1.4), after Robertson (1966).
    """
    return Problem(
        rhs,
        np.array([1.0, 0.0, 0.0]),
        np.append(0.0, duration / 10.0 ** np.arange(frames - 1, -1, -1)),
        name="Robertson",
    )


def rhs(t: Any, y: Any, args: Any) -> Any:
    """The rates of change of the three concentrations; only `y` is used."""
    del t, args
    slow, back, fast = 0.04 * y[0], 1e4 * y[1] * y[2], 3e7 * y[1] * y[1]
    return jnp.stack([back - slow, slow - back - fast, fast])
