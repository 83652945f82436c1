"""Where a stability function stays within the unit disc: intervals on the axes, and a region."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np

from ropeode.theory.growth import bisected
from ropeode.theory.stability_function import LeadingTerm, StabilityFunction
from ropeode.validation import check_positive, check_whole

# Growth in one step that rounding can make of none.
ROUNDING = 1e-11
# How far is looked, and in which steps: near zero evenly, then in proportion.
FARTHEST, _NEAR, _FINE, _COARSE = 1000.0, 40.0, (4000, 1200), (200, 50)
# How often it is looked closer at a maximum of the factor between two points, at how many points.
_ROUNDS, _CLOSER = 4, 16
# Of the end of an interval.
PRECISION = 1e-11
# Points along the sides of a region of a step in Python.
_MOST_IN_PYTHON = 32
_LEAST_BOX, _MOST_BOX, _MARGIN = 3.0, 40.0, 1.35

Radius = Callable[[np.ndarray], np.ndarray]


@dataclasses.dataclass(frozen=True)
class StableInterval:
    """Where nothing grows on a ray from zero.

    Arguments:
        limit: the end of the interval of stability that begins at zero; 0 if there is none.
        looked_to: how far was looked; `limit` is equal to that where no end was found.
        growth: by which power law small steps grow where `limit` is 0, if that is known.
    """

    limit: float
    looked_to: float
    growth: LeadingTerm | None = None

    @property
    def ends(self) -> bool:
        """Whether the end of the interval was found."""
        return self.limit < self.looked_to


@dataclasses.dataclass(frozen=True)
class StabilityLimits:
    """How long steps may be on the two axes.

    Arguments:
        imaginary: up to which ``dt omega`` an oscillation without damping does not grow.
        real: up to which ``-dt lambda`` a decay does not turn into growth; of a mechanical stepper
            up to which ``dt omega`` an oscillator with critical damping; None where it takes no
            damping.
    """

    imaginary: StableInterval
    real: StableInterval | None


@dataclasses.dataclass(frozen=True, eq=False)
class StabilityRegion:
    """The factor of growth on a rectangle of the complex plane, symmetric about the real axis.

    Arguments:
        function: of which.
        real: real parts of z, increasing, ``(columns,)``.
        imaginary: imaginary parts, ``(rows,)``.
        radius: ``|R(z)|``, or the largest of all factors, ``(rows, columns)``.
    """

    function: StabilityFunction
    real: np.ndarray
    imaginary: np.ndarray
    radius: np.ndarray


def stable_interval(
    radius: Radius, grid: np.ndarray, rounding: float = ROUNDING, precision: float = PRECISION
) -> StableInterval:
    """Where the factor of growth is 1 at most, by bisection between the points of a grid.

    An interval of instability that falls between two points, or around one where the factor is
    no local maximum of the grid, is not seen.

    Arguments:
        radius: the factor at distances from zero, ``(distances,)``.
        grid: increasing distances above zero; what is stable at the first counts as stable from 0.
        rounding: growth in a step that counts as none.
        precision: of the end, relative.
    """

    def stable(values: np.ndarray) -> np.ndarray:
        return values <= 1.0 + rounding

    values = radius(grid)
    # Where the factor has a maximum below 1 a hole may hide.
    inner = values[1:-1]
    hidden = 1 + np.flatnonzero(
        stable(inner)
        & (inner > 0.5)
        & (inner >= values[:-2])
        & (inner >= values[2:])
        & ((inner > values[:-2] + rounding) | (inner > values[2:] + rounding))
    )
    low, high = grid[hidden - 1], grid[hidden + 1]
    for _ in range(_ROUNDS if hidden.size else 0):
        closer = np.linspace(low, high, _CLOSER, axis=1)
        there = radius(closer.ravel()).reshape(closer.shape)
        rows, at = np.arange(len(closer)), np.clip(np.argmax(there, axis=1), 1, _CLOSER - 2)
        low, high = closer[rows, at - 1], closer[rows, at + 1]
        grid, order = np.unique(np.append(grid, closer), return_index=True)
        values = np.append(values, there)[order]
    inside = stable(values)
    if np.all(inside) or not inside[0]:
        return StableInterval(float(grid[-1]) if inside[0] else 0.0, float(grid[-1]))
    first = int(np.argmin(inside))
    limit = bisected(
        lambda z: bool(stable(radius(np.array([z])))[0]), grid[first - 1], grid[first], precision
    )
    return StableInterval(limit, float(grid[-1]))


def stability_limits_of(function: StabilityFunction, farthest: float = FARTHEST) -> StabilityLimits:
    """The intervals of stability on the axes.

    Arguments:
        function: of the stepper.
        farthest: how far to look.

    Raises:
        InputError: `farthest` is no number above zero.
    """
    farthest = check_positive("farthest", farthest, example="1000")
    grid = _grid(farthest, *(_FINE if function.is_quick else _COARSE))
    imaginary = stable_interval(lambda y: function.radius(1j * y), grid)
    law = function.amplification
    if law is not None and law.coefficient > 0:
        # However slowly: near zero the growth is below rounding.
        imaginary = dataclasses.replace(imaginary, limit=0.0, growth=law)
    if not function.damped:
        return StabilityLimits(imaginary, None)
    return StabilityLimits(imaginary, stable_interval(lambda x: function.radius(-x + 0j), grid))


def stability_region(
    function: StabilityFunction, limits: StabilityLimits, points: int = 200, reach: float = 0.0
) -> StabilityRegion | None:
    """The factor of growth on a rectangle that shows the region of stability.

    Arguments:
        function: of the stepper.
        limits: its own, which say how large the rectangle has to be.
        points: along each side; a step in Python is asked at fewer, 32 at most.
        reach: a distance from zero that the rectangle has to cover, to the left and up.

    Returns:
        None for a stepper that takes no damping: it has an interval, and no region.

    Raises:
        InputError: `points` is no whole number of 2 or more.
    """
    points = check_whole("points", points, at_least=2, example="200")
    if limits.real is None:
        return None
    if not function.is_quick:
        points = min(points, _MOST_IN_PYTHON)
    wide, high = (
        min(max(_MARGIN * (each.limit if each.ends else 5.0), _LEAST_BOX, reach), _MOST_BOX)
        for each in (limits.real, limits.imaginary)
    )
    real = np.linspace(-wide, 0.4 * max(wide, high), points)
    half = np.linspace(0.0, max(wide, high), (points + 1) // 2)
    above = function.radius(real + 1j * half[:, None])
    return StabilityRegion(
        function,
        real,
        np.concatenate([-half[:0:-1], half]),
        np.concatenate([above[:0:-1], above]),
    )


def _grid(farthest: float, near: int, far: int) -> np.ndarray:
    close = min(_NEAR, farthest)
    grid = np.linspace(close / near, close, near)
    return np.append(grid, np.geomspace(close, farthest, far)[1:]) if farthest > close else grid
