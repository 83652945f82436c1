"""The pendulum, swinging or turning over, with its exact solution."""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from ropeode.problems.parameters import library_problem
from ropeode.problems.picture import Picture
from ropeode.problems.problem import Problem
from ropeode.validation import Finite, Positive, WholePositive

# The arithmetic-geometric mean doubles its digits with each round; it has to get near first
# where the complementary parameter is tiny.
_MOST_ROUNDS = 60
_NEAR = 2.0 * np.finfo(np.longdouble).eps
# Carlson's series is broken off at the fourth power of what this leaves.
_CARLSON_NEAR = 2e-4


class PendulumArgs(NamedTuple):
    """The numbers in the pendulum's equation."""

    length: Any
    gravity: Any


def _rod(times: np.ndarray, states: np.ndarray, args: PendulumArgs) -> np.ndarray:
    """The pivot and the mass, ``(times, 2, 2)``."""
    del times
    angles = states[:, 0, :, 0]
    mass = args.length * np.stack([np.sin(angles), -np.cos(angles)], axis=2)
    return np.concatenate([np.zeros_like(mass), mass], axis=1)


@library_problem(Picture("pendulum", _rod, fixed=(0,), chained=True))
def pendulum(
    frames: WholePositive = 20,
    length: Positive = 1.0,
    gravity: Positive = 1.0,
    angle: Finite = 2.0,
    velocity: Finite = 0.0,
) -> Problem:
    """A mass on a rigid rod without friction, ``length angle'' = -gravity sin(angle)``.

    Its positions have the shape (1, 1). The time unit is one frame.

    Arguments:
        frames: the problem is sampled at times 0, 1, ..., `frames`.
        length: of the rod.
        gravity: acceleration.
        angle: at the start, in radians from hanging down.
        velocity: at the start, in radians per frame.

    Raises:
        InputError: one line for each argument that cannot be used.

    Source: Landau and Lifshitz, Mechanics, section 11, problem 1.
    """
    args = PendulumArgs(length, gravity)
    return Problem.second_order(
        acceleration,
        [[angle]],
        [[velocity]],
        np.arange(frames + 1.0),
        args,
        name="pendulum",
        energy=energy,
        exact=functools.partial(_exact, args, angle, velocity),
    )


def acceleration(t: Any, x: Any, v: Any, args: PendulumArgs) -> Any:
    """Gravity along the circle, over the length; only `x` is used."""
    del t, v
    return -args.gravity / args.length * jnp.sin(x)


def energy(t: Any, y: Any, args: PendulumArgs) -> Any:
    """Kinetic and potential energy for a mass of 1, zero at rest below; `t` is not used."""
    del t
    x, v = y
    # Not 1 - cos, which loses the digits of small swings.
    height = 2.0 * args.length * jnp.sin(x / 2) ** 2
    return jnp.sum(0.5 * (args.length * v) ** 2 + args.gravity * height)


def solution(
    t: Any, length: Any, gravity: Any, angle: Any, velocity: Any
) -> tuple[np.ndarray, np.ndarray]:
    """Angle and angular velocity at times since the start, ``(times,)``, in extended precision.

    With ``w^2 = gravity/length`` the energy makes ``k^2 = sin(angle/2)^2 + (velocity/2w)^2``.
    Below 1 the pendulum swings and ``sin(angle/2) = k sn(w t + a, k^2)``; above, it turns over
    and ``angle/2 = am(k (w t + a), 1/k^2)``; at 1 it comes to rest at the top.

    Arguments:
        t: times, ``(times,)``.
        length: as for `pendulum`, like all that follow.
        gravity: greater than zero.
        angle: at the start.
        velocity: at the start.

    Source: Whittaker, A Treatise on the Analytical Dynamics of Particles and Rigid Bodies,
    section 44.
    """
    t, length, gravity, angle, velocity = (
        np.asarray(value, dtype=np.longdouble) for value in (t, length, gravity, angle, velocity)
    )
    pi = 4 * np.arctan(np.longdouble(1))
    turns = np.rint(angle / (2 * pi))
    half = (angle - 2 * pi * turns) / 2
    rate = np.sqrt(gravity / length)
    # The pendulum that moves the other way is the mirror image.
    mirror = np.where(velocity < 0, -1, 1)
    sine, cosine, speed = mirror * np.sin(half), np.cos(half), abs(velocity) / (2 * rate)
    squared = sine * sine + speed * speed
    # One minus the square, without the difference of near numbers where the angle is large.
    complement = cosine * cosine - speed * speed
    if squared == 0:
        return angle + 0 * t, 0 * t
    if complement > 0:
        k = np.sqrt(squared)
        start = first_kind(sine / k, speed / k, cosine)
        phi = amplitude(rate * t + start, complement)
        rise = np.sqrt(complement + squared * np.cos(phi) ** 2)
        moved, turning = 2 * np.arctan2(k * np.sin(phi), rise), 2 * k * rate * np.cos(phi)
    elif complement == 0:
        start = np.arctanh(sine) if speed else np.longdouble(np.inf)
        moved = 4 * np.arctan(np.tanh((rate * t + start) / 2))
        turning = 2 * rate / np.cosh(rate * t + start)
    else:
        k = np.sqrt(squared)
        start = first_kind(sine, cosine, speed / k)
        phi = amplitude(k * rate * t + start, -complement / squared)
        moved = 2 * phi
        turning = 2 * rate * np.sqrt(-complement + np.cos(phi) ** 2)
    # At the start there is no rounding, and no velocity of 1e-19 where it is at rest.
    begun = t == 0
    return (
        np.where(begun, angle, mirror * moved + 2 * pi * turns),
        np.where(begun, velocity, mirror * turning),
    )


def _exact(args: PendulumArgs, angle: float, velocity: float, ts: np.ndarray) -> np.ndarray:
    states = np.stack(solution(ts, *args, angle, velocity), axis=1)
    return states[..., None, None].astype(np.float64)


def first_kind(sine: Any, cosine: Any, delta: Any) -> np.longdouble:
    """The integral of the first kind, F(phi, m), for ``phi`` from -pi/2 to pi/2.

    Arguments:
        sine: of phi.
        cosine: of phi, not below zero.
        delta: ``sqrt(1 - m sin(phi)^2)``.

    Source: Carlson, Numerical computation of real or complex elliptic integrals, Numerical
    Algorithms 10 (1995), equations (2.1), (2.6) to (2.10) and (4.5).
    """
    sine, cosine, delta = (np.longdouble(value) for value in (sine, cosine, delta))
    x, y, z = cosine * cosine, delta * delta, np.longdouble(1)
    while True:
        mean = (x + y + z) / 3
        off = [1 - each / mean for each in (x, y, z)]
        if max(abs(each) for each in off) < _CARLSON_NEAR:
            break
        a, b, c = np.sqrt(x), np.sqrt(y), np.sqrt(z)
        shift = a * b + b * c + c * a
        x, y, z = (x + shift) / 4, (y + shift) / 4, (z + shift) / 4
    second = off[0] * off[1] - off[2] * off[2]
    third = off[0] * off[1] * off[2]
    series = 1 - second / 10 + third / 14 + second * second / 24 - 3 * second * third / 44
    return sine * series / np.sqrt(mean)


def amplitude(u: Any, complement: Any) -> np.ndarray:
    """Jacobi's amplitude am(u, m), which grows by pi for each two quarter periods.

    Arguments:
        u: any shape.
        complement: ``1 - m``, above zero.

    Source: Abramowitz and Stegun, Handbook of Mathematical Functions, 16.4.
    """
    means, differences = _means(complement)
    phi = np.asarray(u, dtype=np.longdouble) * means[-1] * 2 ** (len(means) - 1)
    for mean, difference in zip(means[:0:-1], differences[:0:-1], strict=True):
        phi = (phi + np.arcsin(difference / mean * np.sin(phi))) / 2
    return phi


def _means(complement: Any) -> tuple[list[np.longdouble], list[np.longdouble]]:
    """The arithmetic means, and half the differences, on the way to the common mean."""
    complement = np.longdouble(complement)
    a, b = np.longdouble(1), np.sqrt(complement)
    means, differences = [a], [np.sqrt(1 - complement)]
    for _ in range(_MOST_ROUNDS):
        a, b, c = (a + b) / 2, np.sqrt(a * b), (a - b) / 2
        means.append(a)
        differences.append(c)
        if c <= _NEAR * a:
            break
    return means, differences
