"""The Arenstorf orbit: a spacecraft between earth and moon that comes back to its start."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np

from ropeode.problems.parameters import library_problem
from ropeode.problems.picture import around
from ropeode.problems.problem import Problem
from ropeode.validation import Positive, WholePositive

# The share of the whole mass that the moon has.
MOON = 0.012277471
START = 0.994
SPEED = -2.00158510637908252240537862224
PERIOD = 17.0652165601579625588917206249


@library_problem(around((-MOON, 0.0), (1.0 - MOON, 0.0)))
def arenstorf(frames: WholePositive = 20, periods: Positive = 1.0) -> Problem:
    """The restricted three-body problem on a closed orbit that passes close to the moon.

    In coordinates that turn with earth and moon, whose distance is 1. Positions have the shape
    (1, 2). An error at the start comes back after one period about 1e4 times as large.

    Arguments:
        frames: number of equal intervals between sample times.
        periods: how many periods they cover together.

    Raises:
        InputError: one line for each argument that cannot be used.

    Source: Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I, section II.0,
    equations (0.1) and (0.2), after Arenstorf (1963).
    """
    return Problem.second_order(
        acceleration,
        [[START, 0.0]],
        [[0.0, SPEED]],
        np.linspace(0.0, periods * PERIOD, frames + 1),
        MOON,
        name="Arenstorf orbit",
        energy=energy,
    )


def acceleration(t: Any, x: Any, v: Any, moon: Any) -> Any:
    """Gravity of earth and moon, centrifugal and Coriolis forces; `t` is not used."""
    del t
    earth = 1.0 - moon
    from_earth, from_moon = x + jnp.array([moon, 0.0]), x - jnp.array([earth, 0.0])
    coriolis = 2.0 * jnp.stack([v[:, 1], -v[:, 0]], axis=1)
    return x + coriolis - earth * _pull(from_earth) - moon * _pull(from_moon)


def energy(t: Any, y: Any, moon: Any) -> Any:
    """Jacobi's integral, which is constant; `t` is not used."""
    del t
    x, v = y
    earth = 1.0 - moon
    to_earth = jnp.sqrt(jnp.sum((x + jnp.array([moon, 0.0])) ** 2))
    to_moon = jnp.sqrt(jnp.sum((x - jnp.array([earth, 0.0])) ** 2))
    return 0.5 * jnp.sum(v * v - x * x) - earth / to_earth - moon / to_moon


def _pull(apart: Any) -> Any:
    return apart / jnp.sum(apart * apart) ** 1.5
