"""The Pleiades: seven stars in a plane that pass each other closely."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np

from ropeode.problems.parameters import library_problem
from ropeode.problems.problem import Problem
from ropeode.validation import Positive, WholePositive

POSITIONS = ((3, 3), (3, -3), (-1, 2), (-3, 0), (2, 0), (-2, -4), (2, 4))
VELOCITIES = ((0, 0), (0, 0), (0, 0), (0, -1.25), (0, 1), (1.75, 0), (-1.5, 0))


@library_problem()
def pleiades(frames: WholePositive = 20, duration: Positive = 3.0) -> Problem:
    """Seven stars of the masses 1 to 7 under each other's gravity, in a plane.

    Positions have the shape (7, 2).

    Arguments:
        frames: number of equal intervals between sample times.
        duration: time that they cover together.

    Raises:
        InputError: one line for each argument that cannot be used.

    Source: Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I, section II.10,
    equations (10.2) and (10.3).
    """
    return Problem.second_order(
        acceleration,
        POSITIONS,
        VELOCITIES,
        np.linspace(0.0, duration, frames + 1),
        np.arange(1.0, 8.0),
        name="Pleiades",
        energy=energy,
    )


def acceleration(t: Any, x: Any, v: Any, masses: Any) -> Any:
    """Gravity with a constant of 1; only `x` is used."""
    del t, v
    apart = x[None, :, :] - x[:, None, :]
    pull = apart / _squares(apart)[:, :, None] ** 1.5
    return jnp.sum(masses[None, :, None] * pull, axis=1)


def energy(t: Any, y: Any, masses: Any) -> Any:
    """Kinetic and potential energy, which is constant; `t` is not used."""
    del t
    x, v = y
    squares = _squares(x[None, :, :] - x[:, None, :])
    pairs = jnp.triu(masses[None, :] * masses[:, None] / jnp.sqrt(squares), 1)
    return 0.5 * jnp.sum(masses[:, None] * v * v) - jnp.sum(pairs)


def _squares(apart: Any) -> Any:
    """Squared distances; 1 of a star from itself, where there is nothing to divide."""
    return jnp.sum(apart * apart, axis=2) + jnp.eye(len(apart))
