"""The Kepler problem: a planet around a fixed sun."""

from __future__ import annotations

import functools
from fractions import Fraction
from typing import Annotated, Any

import jax.numpy as jnp
import numpy as np
from pydantic import Field

from ropeode.problems.parameters import library_problem
from ropeode.problems.picture import around
from ropeode.problems.problem import Problem
from ropeode.validation import NonNegative, Positive, WholePositive

# Newton's iteration takes at most 12 rounds at the eccentricities that are allowed.
_ROUNDS = 20
# The series of the sine below 1 in extended precision.
_TERMS = 12


# Nearer to 1, rounding the initial velocity changes the period by more than 1e-12.
Eccentricity = Annotated[NonNegative, Field(le=0.9999), "a number from 0 to 0.9999"]


@library_problem(around((0.0, 0.0)))
def kepler(
    frames: WholePositive = 20, eccentricity: Eccentricity = 0.5, periods: Positive = 1.0
) -> Problem:
    """A planet around a sun at the origin, ``x'' = -x/|x|^3``, from the pericentre.

    The semi-major axis is 1 and the period 2 pi, but for the rounding of the initial state.
    Positions have the shape (1, 2).

    Arguments:
        frames: number of equal intervals between sample times.
        eccentricity: of the orbit; 0 is a circle.
        periods: how many periods the frames cover together.

    Raises:
        InputError: one line for each argument that cannot be used.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, section I.2.
    """
    distance = 1.0 - eccentricity
    speed = float(np.sqrt((1.0 + eccentricity) / (1.0 - eccentricity)))
    return Problem.second_order(
        acceleration,
        [[distance, 0.0]],
        [[0.0, speed]],
        2.0 * np.pi * periods * np.arange(frames + 1) / frames,
        name="Kepler",
        energy=energy,
        exact=functools.partial(_exact, distance, speed),
    )


def acceleration(t: Any, x: Any, v: Any, args: Any) -> Any:
    """Gravity of a sun with ``G M = 1``; only `x` is used."""
    del t, v, args
    return -x / jnp.sum(x * x) ** 1.5


def energy(t: Any, y: Any, args: Any) -> Any:
    """Energy per mass of the planet, which is constant; only `y` is used."""
    del t, args
    x, v = y
    return 0.5 * jnp.sum(v * v) - 1.0 / jnp.sqrt(jnp.sum(x * x))


def solution(t: Any, distance: float, speed: float) -> tuple[np.ndarray, np.ndarray]:
    """Position and velocity at times since the pericentre, ``(times, 2)``.

    In extended precision, and without differences of near numbers close to the sun.

    Arguments:
        t: times, ``(times,)``.
        distance: of the pericentre, on the positive x axis.
        speed: there, along the positive y axis; below that of escape.

    Source: Murray and Dermott, Solar System Dynamics, section 2.4. What they write with the
    eccentricity is written with distance and speed, which are known without rounding.
    """
    r, w = np.longdouble(distance), np.longdouble(speed)
    # Distance times speed squared is one plus the eccentricity.
    one_minus_e = _extended(2 - Fraction(distance) * Fraction(speed) ** 2)
    e = 1 - one_minus_e
    axis = r / one_minus_e
    mean_motion = np.sqrt(axis) / axis**2
    anomaly = eccentric_anomaly(mean_motion * np.asarray(t, dtype=np.longdouble), one_minus_e)
    sine, half_sine = np.sin(anomaly), np.sin(anomaly / 2)
    from_sun = r + 2 * axis * e * half_sine**2
    x = np.stack([r - 2 * axis * half_sine**2, r * w * np.sqrt(axis) * sine], axis=1)
    v = np.stack([-np.sqrt(axis) * sine, r * w * (1 - 2 * half_sine**2)], axis=1)
    return x, v / from_sun[:, None]


def eccentric_anomaly(mean: np.ndarray, one_minus_e: Any) -> np.ndarray:
    """Solve Kepler's equation ``E - e sin E = mean``, up to whole turns.

    On half a turn the left side grows and is convex, so that Newton's iteration, begun
    above the solution, falls towards it.

    Arguments:
        mean: mean anomaly, in radians, extended precision.
        one_minus_e: one minus the eccentricity, above zero.
    """
    pi = 4 * np.arctan(np.longdouble(1))
    mean = mean - 2 * pi * np.rint(mean / (2 * pi))
    size, e = np.abs(mean), 1 - one_minus_e
    anomaly = np.minimum(np.minimum(pi, size + np.abs(e)), size / one_minus_e)
    for _ in range(_ROUNDS):
        slope = one_minus_e + 2 * e * np.sin(anomaly / 2) ** 2
        anomaly -= (one_minus_e * anomaly + e * _minus_sine(anomaly) - size) / slope
    return np.copysign(anomaly, mean)


def _minus_sine(angle: np.ndarray) -> np.ndarray:
    """``angle - sin(angle)``, by the sine's series where the two are near."""
    small = np.where(np.abs(angle) < 1, angle, 0)
    term, series = small, np.zeros_like(small)
    for k in range(1, _TERMS):
        term = -term * small * small / (2 * k * (2 * k + 1))
        series -= term
    return np.where(np.abs(angle) < 1, series, angle - np.sin(angle))


def _extended(number: Fraction) -> np.longdouble:
    """The nearest number in extended precision, but for its last digit."""
    high = float(number)
    return np.longdouble(high) + np.longdouble(float(number - Fraction(high)))


def _exact(distance: float, speed: float, ts: np.ndarray) -> np.ndarray:
    return np.stack(solution(ts, distance, speed), axis=1)[:, :, None].astype(np.float64)
