"""HIRES: how light makes a plant grow, in eight concentrations."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np

from ropeode.problems.parameters import library_problem
from ropeode.problems.picture import plane
from ropeode.problems.problem import Problem
from ropeode.validation import Positive, WholePositive


@library_problem(plane(4, 5, ("y5", "y6")))
def hires(frames: WholePositive = 20, duration: Positive = 321.8122) -> Problem:
    """The high irradiance response of a plant, a stiff reaction of eight substances.

    The state has the shape (8,).

    Arguments:
        frames: number of equal intervals between sample times.
        duration: time that they cover together.

    Raises:
        InputError: one line for each argument that cannot be used.

    Source: Hairer and Wanner, Solving Ordinary Differential Equations II, section IV.10,
    equation (10.4), after Schäfer (1975).
    """
    return Problem(
        rhs,
        np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0057]),
        np.linspace(0.0, duration, frames + 1),
        name="HIRES",
    )


def rhs(t: Any, y: Any, args: Any) -> Any:
    """The rates of change of the eight concentrations; only `y` is used."""
    del t, args
    bound = 280.0 * y[5] * y[7]
    return jnp.stack(
        [
            -1.71 * y[0] + 0.43 * y[1] + 8.32 * y[2] + 0.0007,
            1.71 * y[0] - 8.75 * y[1],
            -10.03 * y[2] + 0.43 * y[3] + 0.035 * y[4],
            8.32 * y[1] + 1.71 * y[2] - 1.12 * y[3],
            -1.745 * y[4] + 0.43 * y[5] + 0.43 * y[6],
            -bound + 0.69 * y[3] + 1.71 * y[4] - 0.43 * y[5] + 0.69 * y[6],
            bound - 1.81 * y[6],
            -bound + 1.81 * y[6],
        ]
    )
