"""Close encounters: a spacecraft that passes the moon, and seven stars."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np

from ropeode.problems.parameters import library_problem
from ropeode.problems.picture import around
from ropeode.problems.problem import Problem
from ropeode.validation import Positive, WholePositive

# The share of the whole mass that the moon has.
_MOON = 0.012277471
_START = 0.994
_SPEED = -2.00158510637908252240537862224
_PERIOD = 17.0652165601579625588917206249


@library_problem(around((-_MOON, 0.0), (1.0 - _MOON, 0.0)))
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
        arenstorf_acceleration,
        [[_START, 0.0]],
        [[0.0, _SPEED]],
        np.linspace(0.0, periods * _PERIOD, frames + 1),
        _MOON,
        name="Arenstorf orbit",
        energy=arenstorf_energy,
    )


def arenstorf_acceleration(t: Any, x: Any, v: Any, moon: Any) -> Any:
    """Gravity of earth and moon, centrifugal and Coriolis forces; `t` is not used."""
    del t
    earth = 1.0 - moon
    from_earth, from_moon = x + jnp.array([moon, 0.0]), x - jnp.array([earth, 0.0])
    coriolis = 2.0 * jnp.stack([v[:, 1], -v[:, 0]], axis=1)
    return x + coriolis - earth * _pull(from_earth) - moon * _pull(from_moon)


def arenstorf_energy(t: Any, y: Any, moon: Any) -> Any:
    """Jacobi's integral, which is constant; `t` is not used."""
    del t
    x, v = y
    earth = 1.0 - moon
    to_earth = jnp.sqrt(jnp.sum((x + jnp.array([moon, 0.0])) ** 2))
    to_moon = jnp.sqrt(jnp.sum((x - jnp.array([earth, 0.0])) ** 2))
    return 0.5 * jnp.sum(v * v - x * x) - earth / to_earth - moon / to_moon


def _pull(apart: Any) -> Any:
    return apart / jnp.sum(apart * apart) ** 1.5


_POSITIONS = ((3, 3), (3, -3), (-1, 2), (-3, 0), (2, 0), (-2, -4), (2, 4))
_VELOCITIES = ((0, 0), (0, 0), (0, 0), (0, -1.25), (0, 1), (1.75, 0), (-1.5, 0))


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
        pleiades_acceleration,
        _POSITIONS,
        _VELOCITIES,
        np.linspace(0.0, duration, frames + 1),
        np.arange(1.0, 8.0),
        name="Pleiades",
        energy=pleiades_energy,
    )


def pleiades_acceleration(t: Any, x: Any, v: Any, masses: Any) -> Any:
    """Gravity with a constant of 1; only `x` is used."""
    del t, v
    apart = x[None, :, :] - x[:, None, :]
    pull = apart / _squares(apart)[:, :, None] ** 1.5
    return jnp.sum(masses[None, :, None] * pull, axis=1)


def pleiades_energy(t: Any, y: Any, masses: Any) -> Any:
    """Kinetic and potential energy, which is constant; `t` is not used."""
    del t
    x, v = y
    squares = _squares(x[None, :, :] - x[:, None, :])
    pairs = jnp.triu(masses[None, :] * masses[:, None] / jnp.sqrt(squares), 1)
    return 0.5 * jnp.sum(masses[:, None] * v * v) - jnp.sum(pairs)


def _squares(apart: Any) -> Any:
    """Squared distances; 1 of a star from itself, where there is nothing to divide."""
    return jnp.sum(apart * apart, axis=2) + jnp.eye(len(apart))
