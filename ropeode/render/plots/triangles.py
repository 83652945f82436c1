"""Slope triangles beside the fitted lines of a log-log plot."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes

# In parts of the axes' width and height.
_LEG = 0.09
_GAP = 0.03
_EDGE = 0.03
_PLACES = 13
_WIDER_THAN_HIGH = 1.7


class FittedLine(NamedTuple):
    """A power law over a range of step sizes.

    Fields:
        slope: as fitted.
        dts: step sizes, ``(points,)``.
        errors: of the fit there, ``(points,)``.
    """

    slope: float
    dts: np.ndarray
    errors: np.ndarray


def draw_triangles(
    axes: Axes, lines: Sequence[FittedLine], points: np.ndarray, floor: float
) -> None:
    """A triangle for each observed order, where it covers the least.

    Arguments:
        axes: with their limits set.
        lines: all the fitted ones.
        points: all that is drawn, ``(points, 2)``, step sizes and errors.
        floor: an error below which there is no place.
    """
    to_axes = _Scale(axes)
    taken = to_axes(points)
    lowest = to_axes(np.array([[points[0, 0], floor]]))[0, 1]
    for order in sorted({order for line in lines if (order := round(line.slope)) > 0}):
        own = [line for line in lines if round(line.slope) == order]
        places = [
            (_clearance(corners, taken), corners)
            for line in own
            for corners in _places(to_axes, line, order)
            if corners[:, 0].min() > _EDGE and corners[:, 0].max() < 1 - 2 * _EDGE
            if lowest + _EDGE < corners[:, 1].min() and corners[:, 1].max() < 1 - _EDGE
        ]
        if places:
            corners = max(places, key=lambda each: each[0])[1]
            taken = np.concatenate([taken, corners])
            _draw(axes, corners, order)


class _Scale:
    """From data to parts of the axes, both logarithmic."""

    def __init__(self, axes: Axes):
        ends = np.log(np.array([axes.get_xlim(), axes.get_ylim()])).T
        self.start, self.span = ends[0], ends[1] - ends[0]

    def __call__(self, points: np.ndarray) -> np.ndarray:
        return (np.log(points) - self.start) / self.span


def _places(to_axes: _Scale, line: FittedLine, order: int) -> Iterable[np.ndarray]:
    """Corners ``(3, 2)``, the right angle in the middle, on both sides along the line."""
    ends = to_axes(np.stack([line.dts, line.errors], axis=1))
    rise = order * _LEG * to_axes.span[0] / to_axes.span[1]
    along = np.linspace(0.0, 1.0, _PLACES)[:, None]
    starts = ends[0] + along * (ends[-1] - ends[0] - (_LEG, rise))
    for (x, y), side in itertools.product(starts, (-1, 1)):
        y += side * (_GAP + 0.5 * abs(rise))
        corner = (x + _LEG, y) if side < 0 else (x, y + rise)
        yield np.array([(x, y), corner, (x + _LEG, y + rise)])


def _clearance(corners: np.ndarray, taken: np.ndarray) -> float:
    middles = (corners + np.roll(corners, 1, axis=0)) / 2
    apart = np.concatenate([corners, middles])[:, None] - taken
    return float(np.min(np.hypot(_WIDER_THAN_HIGH * apart[..., 0], apart[..., 1])))


def _draw(axes: Axes, corners: np.ndarray, order: int) -> None:
    axes.fill(
        *corners.T, transform=axes.transAxes, facecolor="0.93", edgecolor="0.35", linewidth=0.8
    )
    (x0, _), (xc, yc), (x1, _) = corners
    below = xc == x1
    words = {"transform": axes.transAxes, "fontsize": 7, "color": "0.2"}
    axes.text(
        xc + (0.006 if below else -0.006),
        float(np.mean(corners[[0, 2], 1])),
        str(order),
        ha="left" if below else "right",
        va="center",
        **words,
    )
    axes.text(
        (x0 + x1) / 2, yc - (0.008 if below else -0.008), "1", ha="center",
        va="top" if below else "bottom", **words,
    )  # fmt: skip
