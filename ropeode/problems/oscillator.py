"""The damped harmonic oscillator."""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from ropeode.problems.links import LinearDamping
from ropeode.problems.parameters import library_problem
from ropeode.problems.picture import Picture
from ropeode.problems.problem import Problem
from ropeode.validation import Finite, NonNegative, Positive, WholePositive


class OscillatorArgs(NamedTuple):
    """The numbers in the oscillator's equation."""

    mass: Any
    stiffness: Any
    damping: Any


def _on_its_spring(times: np.ndarray, states: np.ndarray, args: OscillatorArgs) -> np.ndarray:
    """The wall, well to the left of where the mass starts, and the mass."""
    del times, args
    mass = np.concatenate([states[:, 0], np.zeros_like(states[:, 0])], axis=2)
    wall = np.zeros_like(mass)
    wall[..., 0] = -2.0 * np.abs(mass[0, 0, 0]) - 1.0
    return np.concatenate([wall, mass], axis=1)


@library_problem(Picture("rope", _on_its_spring, ("displacement", ""), fixed=(0,), chained=True))
def oscillator(
    frames: WholePositive = 20,
    mass: Positive = 1.0,
    stiffness: Positive = 1.0,
    damping: NonNegative = 0.1,
    x0: Finite = 1.0,
    v0: Finite = 0.0,
) -> Problem:
    """A mass on a linear spring, ``mass x'' = -stiffness x - damping x'``.

    Its positions have the shape (1, 1). The time unit is one frame.

    Arguments:
        frames: the problem is sampled at times 0, 1, ..., `frames`.
        mass: mass.
        stiffness: force per length of the spring.
        damping: force per velocity; ``2 sqrt(mass stiffness)`` is critical.
        x0: initial displacement, in the unit of length.
        v0: initial velocity, in lengths per frame.

    Raises:
        InputError: one line for each argument that cannot be used.

    Source: Landau and Lifshitz, Mechanics, section 25.
    """
    args = OscillatorArgs(mass, stiffness, damping)
    return Problem.second_order(
        acceleration,
        [[x0]],
        [[v0]],
        np.arange(frames + 1.0),
        args,
        damping=linear_damping,
        name="oscillator",
        energy=energy,
        exact=functools.partial(_exact, args, x0, v0),
    )


def acceleration(t: Any, x: Any, v: Any, args: OscillatorArgs) -> Any:
    """The forces of spring and damper over the mass; `t` is not used."""
    del t
    return -(args.stiffness * x + args.damping * v) / args.mass


def linear_damping(args: OscillatorArgs) -> LinearDamping:
    """The damping force as an acceleration."""
    return LinearDamping(args.damping / args.mass, args.damping)


def energy(t: Any, y: Any, args: OscillatorArgs) -> Any:
    """Kinetic energy and the spring's; constant without damping. `t` is not used."""
    del t
    x, v = y
    return 0.5 * jnp.sum(args.mass * v * v + args.stiffness * x * x)


def solution(
    t: Any, mass: Any, stiffness: Any, damping: Any, x0: Any, v0: Any
) -> tuple[np.ndarray, np.ndarray]:
    """Displacement and velocity at times since the start, in extended precision.

    Each of the two forms is free of cancellation up to the critical damping itself. What
    rounding does to the discriminant changes the result by the rounding error times
    ``(omega t)^2 exp(-gamma t)``, which is harmless where the two are nearly equal.

    Arguments:
        t: times, which broadcast against all the others.
        mass: as for `oscillator`, like all that follow.
        stiffness: greater than zero.
        damping: not below zero.
        x0: initial displacement.
        v0: initial velocity.

    Source: Landau and Lifshitz, Mechanics, section 25; where damping is stronger than
    critical, written with the divided difference of the exponential function between the
    two rates instead of a sum of two exponentials, whose factors grow without limit there.
    """
    t, mass, stiffness, damping, x0, v0 = (
        np.asarray(value, dtype=np.longdouble) for value in (t, mass, stiffness, damping, x0, v0)
    )
    gamma = damping / (2 * mass)
    omega_squared = stiffness / mass
    discriminant = (4 * mass * stiffness - damping * damping) / (4 * mass * mass)
    strong = discriminant < 0

    frequency = np.sqrt(np.where(strong, 0, discriminant))
    decay, cosine = np.exp(-gamma * t), np.cos(frequency * t)
    sine = t * _ratio(np.sin, frequency * t)
    weak_x = decay * (x0 * cosine + (v0 + gamma * x0) * sine)
    weak_v = decay * (v0 * cosine - (omega_squared * x0 + gamma * v0) * sine)

    half_gap = np.sqrt(np.where(strong, -discriminant, 0))
    fast = -(gamma + half_gap)
    # The product of the rates is known: no difference of near numbers for the slow one.
    slow = -omega_squared / np.where(strong, -fast, 1)
    excess = v0 - slow * x0
    strong_x = np.exp(slow * t) * (x0 + excess * t * _ratio(np.expm1, -2 * half_gap * t))
    strong_v = slow * strong_x + excess * np.exp(fast * t)
    return np.where(strong, strong_x, weak_x), np.where(strong, strong_v, weak_v)


def _ratio(function: Any, z: np.ndarray) -> np.ndarray:
    """``function(z)/z``, and its limit 1 at zero."""
    safe = np.where(z == 0, 1, z)
    return np.where(z == 0, 1, function(safe) / safe)


def _exact(args: OscillatorArgs, x0: float, v0: float, ts: np.ndarray) -> np.ndarray:
    return np.stack(solution(ts, *args, x0, v0), axis=1)[..., None, None].astype(np.float64)
