"""The Hénon-Heiles system: a star in the plane of a galaxy."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np

from ropeode.problems.parameters import library_problem
from ropeode.problems.picture import around
from ropeode.problems.problem import Problem
from ropeode.validation import FinitePair, Positive, WholePositive


@library_problem(around((0.0, 0.0)))
def henon_heiles(
    frames: WholePositive = 20,
    duration: Positive = 20.0,
    position: FinitePair = (0.0, 0.1),
    velocity: FinitePair = (0.49, 0.0),
) -> Problem:
    """A star that is drawn to the centre, ``x'' = -x - 2 x y``, ``y'' = -y - x^2 + y^2``.

    Up to an energy of 1/6 it cannot leave; from about 1/9 on, some motions are chaotic, and
    the default one, whose energy is 0.125, is. Positions have the shape (1, 2).

    Arguments:
        frames: number of equal intervals between sample times.
        duration: time that they cover together.
        position: x and y at the start.
        velocity: at the start.

    Raises:
        InputError: one line for each argument that cannot be used.

    Source: Hénon and Heiles, The applicability of the third integral of motion, Astronomical
    Journal 69 (1964), equation (11).
    """
    return Problem.second_order(
        acceleration,
        [position],
        [velocity],
        np.linspace(0.0, duration, frames + 1),
        name="Hénon-Heiles",
        energy=energy,
    )


def acceleration(t: Any, x: Any, v: Any, args: Any) -> Any:
    """The slope of the potential; only `x` is used."""
    del t, v, args
    a, b = x[:, 0], x[:, 1]
    return jnp.stack([-a - 2.0 * a * b, -b - a * a + b * b], axis=1)


def energy(t: Any, y: Any, args: Any) -> Any:
    """Energy for a mass of 1, which is constant; only `y` is used."""
    del t, args
    x, v = y
    a, b = x[:, 0], x[:, 1]
    return jnp.sum(0.5 * (jnp.sum(v * v, axis=1) + a * a + b * b) + a * a * b - b**3 / 3.0)
