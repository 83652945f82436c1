"""Chaotic motions: two pendulums, a star in a galaxy, and convection in three numbers."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from ropeode.problems.parameters import library_problem
from ropeode.problems.picture import Picture, around, plane
from ropeode.problems.problem import Problem
from ropeode.validation import (
    Finite,
    FinitePair,
    FiniteTriple,
    Positive,
    PositivePair,
    WholePositive,
)


class DoublePendulumArgs(NamedTuple):
    """The numbers in the equations; masses and lengths are ``(2,)``, the upper one first."""

    masses: Any
    lengths: Any
    gravity: Any


def _double_pendulum_rods(
    times: np.ndarray, states: np.ndarray, args: DoublePendulumArgs
) -> np.ndarray:
    """The pivot and the two masses, ``(times, 3, 2)``."""
    del times
    angles = states[:, 0, :, 0]
    rods = np.stack([np.sin(angles), -np.cos(angles)], axis=2) * args.lengths[:, None]
    return np.cumsum(np.concatenate([np.zeros_like(rods[:, :1]), rods], axis=1), axis=1)


@library_problem(Picture("pendulum", _double_pendulum_rods, fixed=(0,), chained=True))
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
        double_pendulum_acceleration,
        np.reshape(angles, (2, 1)),
        np.reshape(velocities, (2, 1)),
        np.arange(frames + 1.0),
        DoublePendulumArgs(np.array(masses), np.array(lengths), gravity),
        name="double pendulum",
        energy=double_pendulum_energy,
    )


def double_pendulum_acceleration(t: Any, x: Any, v: Any, args: DoublePendulumArgs) -> Any:
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


def double_pendulum_energy(t: Any, y: Any, args: DoublePendulumArgs) -> Any:
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
        henon_heiles_acceleration,
        [position],
        [velocity],
        np.linspace(0.0, duration, frames + 1),
        name="Hénon-Heiles",
        energy=henon_heiles_energy,
    )


def henon_heiles_acceleration(t: Any, x: Any, v: Any, args: Any) -> Any:
    """The slope of the potential; only `x` is used."""
    del t, v, args
    a, b = x[:, 0], x[:, 1]
    return jnp.stack([-a - 2.0 * a * b, -b - a * a + b * b], axis=1)


def henon_heiles_energy(t: Any, y: Any, args: Any) -> Any:
    """Energy for a mass of 1, which is constant; only `y` is used."""
    del t, args
    x, v = y
    a, b = x[:, 0], x[:, 1]
    return jnp.sum(0.5 * (jnp.sum(v * v, axis=1) + a * a + b * b) + a * a * b - b**3 / 3.0)


class LorenzArgs(NamedTuple):
    """The numbers in the equations."""

    sigma: Any
    rho: Any
    beta: Any


@library_problem(plane(0, 2, ("x", "z")))
def lorenz(
    frames: WholePositive = 20,
    duration: Positive = 10.0,
    sigma: Finite = 10.0,
    rho: Finite = 28.0,
    beta: Finite = 8.0 / 3.0,
    y0: FiniteTriple = (1.0, 1.0, 1.0),
) -> Problem:
    """``x' = sigma (y - x)``, ``y' = x (rho - z) - y``, ``z' = x y - beta z``.

    The state has the shape (3,).

    Arguments:
        frames: number of equal intervals between sample times.
        duration: time that they cover together.
        sigma: Prandtl number.
        rho: Rayleigh number over its critical value.
        beta: from the shape of the convection cells.
        y0: x, y and z at the start.

    Raises:
        InputError: one line for each argument that cannot be used.

    Source: Lorenz, Deterministic nonperiodic flow, Journal of the Atmospheric Sciences 20
    (1963), equations (25) to (27).
    """
    return Problem(
        lorenz_rhs,
        np.array(y0),
        np.linspace(0.0, duration, frames + 1),
        LorenzArgs(sigma, rho, beta),
        name="Lorenz",
    )


def lorenz_rhs(t: Any, y: Any, args: LorenzArgs) -> Any:
    """The derivative of `y`; `t` is not used."""
    del t
    x, y, z = y
    return jnp.stack([args.sigma * (y - x), x * (args.rho - z) - y, x * y - args.beta * z])
