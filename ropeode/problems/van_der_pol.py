"""Van der Pol's oscillator, stiff or not."""

from __future__ import annotations

from typing import Any

import numpy as np

from ropeode.problems.parameters import library_problem
from ropeode.problems.picture import plane
from ropeode.problems.problem import Problem
from ropeode.validation import Finite, Positive, WholePositive


@library_problem(plane(0, 1, ("x", "x'")))
def van_der_pol(
    frames: WholePositive = 20,
    duration: Positive = 2.0,
    epsilon: Positive = 0.1,
    x0: Finite = 2.0,
    v0: Finite = 0.0,
) -> Problem:
    """A circuit that swings by itself, ``epsilon x'' = (1 - x^2) x' - x``.

    With ``mu = 1/sqrt(epsilon)`` and time in units of mu this is ``x'' = mu (1 - x^2) x' - x``.
    An epsilon of 1e-6 makes the well-known stiff problem. Positions have the shape (1, 1).

    Arguments:
        frames: number of equal intervals between sample times.
        duration: time that they cover together.
        epsilon: how fast the fast part is.
        x0: at the start.
        v0: its derivative at the start.

    Raises:
        InputError: one line for each argument that cannot be used.

    Source: Hairer and Wanner, Solving Ordinary Differential Equations II, section IV.1,
    equation (1.5').
    """
    return Problem.second_order(
        acceleration,
        [[x0]],
        [[v0]],
        np.linspace(0.0, duration, frames + 1),
        epsilon,
        name="Van der Pol",
    )


def acceleration(t: Any, x: Any, v: Any, epsilon: Any) -> Any:
    """Damping that drives small swings, and a spring; `t` is not used."""
    del t
    return ((1.0 - x * x) * v - x) / epsilon
