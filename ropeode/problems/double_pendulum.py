"""The double pendulum: one pendulum hangs from the mass of another."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from ropeode.problems.parameters import library_problem
from ropeode.problems.picture import Picture
from ropeode.problems.problem import Problem
from ropeode.validation import FinitePair, Positive, PositivePair, WholePositive


class DoublePendulumArgs(NamedTuple):
    """The numbers in the equations; masses and lengths are ``(2,)``, the upper one first."""

    masses: Any
    lengths: Any
    gravity: Any


def _rods(times: np.ndarray, states: np.ndarray, args: DoublePendulumArgs) -> np.ndarray:
    """The pivot and the two masses, ``(times, 3, 2)``."""
    del times
    angles = states[:, 0, :, 0]
    rods = np.stack([np.sin(angles), -np.cos(angles)], axis=2) * args.lengths[:, None]
    return np.cumsum(np.concatenate([np.zeros_like(rods[:, :1]), rods], axis=1), axis=1)


@library_problem(Picture("pendulum", _rods, fixed=(0,), chained=True))
def double_pendulum(
    frames: WholePositive = 20,
    masses: PositivePair = (1.0, 1.0),
    lengths: PositivePair = (1.0, 1.0),
    gravity: Positive = 1.0,
    angles: FinitePair = (2.0, 2.5),
    velocities: FinitePair = (0.0, 0.0),
) -> Problem:
    """Two masses on rigid rods without friction, the second hanging from the first.

    Positions are the angles from hanging down, in radians, of shape (2, 1). The time unit is
    one frame. Released from high up, as here, it is chaotic.

    Arguments:
        frames: the problem is sampled at times 0, 1, ..., `frames`.
        masses: of the upper and the lower mass.
        lengths: of the upper and the lower rod.
        gravity: acceleration.
        angles: at the start, in radians.
        velocities: at the start, in radians per frame.

    Raises:
        InputError: one line for each argument that cannot be used.

    Source: Landau and Lifshitz, Mechanics, section 5, problem 1 (the Lagrangian).
    """
    return Problem.second_order(
        acceleration,
        np.reshape(angles, (2, 1)),
        np.reshape(velocities, (2, 1)),
        np.arange(frames + 1.0),
        DoublePendulumArgs(np.array(masses), np.array(lengths), gravity),
        name="double pendulum",
        energy=energy,
    )


def acceleration(t: Any, x: Any, v: Any, args: DoublePendulumArgs) -> Any:
    """Lagrange's equations, solved for the two angular accelerations; `t` is not used."""
    del t
    (m1, m2), (l1, l2), g = args.masses, args.lengths, args.gravity
    (upper, lower), (spin_upper, spin_lower) = x[:, 0], v[:, 0]
    sine, cosine = jnp.sin(upper - lower), jnp.cos(upper - lower)
    first = -m2 * l2 * spin_lower**2 * sine - (m1 + m2) * g * jnp.sin(upper)
    second = l1 * spin_upper**2 * sine - g * jnp.sin(lower)
    of_upper = (first - m2 * cosine * second) / (l1 * (m1 + m2 * sine**2))
    of_lower = (second - l1 * cosine * of_upper) / l2
    return jnp.stack([of_upper, of_lower])[:, None]


def energy(t: Any, y: Any, args: DoublePendulumArgs) -> Any:
    """Kinetic and potential energy, zero at rest below; `t` is not used."""
    del t
    (m1, m2), (l1, l2), g = args.masses, args.lengths, args.gravity
    (upper, lower), (spin_upper, spin_lower) = y[0, :, 0], y[1, :, 0]
    kinetic = (
        0.5 * (m1 + m2) * (l1 * spin_upper) ** 2
        + 0.5 * m2 * (l2 * spin_lower) ** 2
        + m2 * l1 * l2 * spin_upper * spin_lower * jnp.cos(upper - lower)
    )
    heights = 2.0 * l1 * jnp.sin(upper / 2) ** 2, 2.0 * l2 * jnp.sin(lower / 2) ** 2
    return kinetic + g * ((m1 + m2) * heights[0] + m2 * heights[1])
