"""The marker of each run in the convergence plot: used for the order, or left out, and why."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from matplotlib.path import Path

from ropeode.analysis import PRE_ASYMPTOTIC, ROUND_OFF, TOO_FEW, UNRESOLVED, UNSOLVED, UNSTABLE
from ropeode.study import AccuracyTable, Row

OFF_AXIS = "unstable, error above this axis"
DIVERGED = "unstable, diverged"

_M, _L = Path.MOVETO, Path.LINETO
# Both are drawn below the point: one hangs from the resolution, the other's tip is at the edge.
_ARROW_DOWN = Path([(0, 0), (0, -2), (-0.6, -1.3), (0, -2), (0.6, -1.3)], [_M, _L, _M, _L, _L])
_ARROW_UP = Path([(0, -2), (0, 0), (-0.6, -0.7), (0, 0), (0.6, -0.7)], [_M, _L, _M, _L, _L])
_HOLLOW = {"markerfacecolor": "none"}

MARKS: dict[str, dict[str, Any]] = {
    UNSTABLE: {"marker": "x"},
    OFF_AXIS: {"marker": _ARROW_UP, "markersize": 12, "clip_on": False, **_HOLLOW},
    DIVERGED: {"marker": "X", "markersize": 7, "clip_on": False},
    UNSOLVED: {"marker": "P", "markersize": 7, "clip_on": False},
    PRE_ASYMPTOTIC: {"marker": "+", "markersize": 9, "markeredgewidth": 1.5},
    ROUND_OFF: {"marker": "*", "markersize": 7, **_HOLLOW},
    UNRESOLVED: {"marker": _ARROW_DOWN, "markersize": 12, **_HOLLOW},
    TOO_FEW: {"marker": "d", **_HOLLOW},
}


def in_legend(mark: str) -> dict[str, Any]:
    """The mark as a legend shows it, centred."""
    form = {**MARKS[mark], "clip_on": True}
    if isinstance(form["marker"], Path):
        form["marker"] = Path(np.add(form["marker"].vertices, (0.0, 1.0)), form["marker"].codes)
        form["markersize"] /= 2
    return form


class Point(NamedTuple):
    """One run in the plot.

    Fields:
        dt: step size.
        error: where it is drawn.
        mark: a key of `MARKS`; None for a run that the order's fit used.
    """

    dt: float
    error: float
    mark: str | None


def limits(table: AccuracyTable) -> tuple[float, float]:
    """The ends of the error axis.

    A run that blew up does not stretch it, nor does a resolution far below all errors.
    """
    reasons = _reasons(table)
    errors = [row.error_max for row in table.rows if row.error_max]
    stable = [
        row.error_max
        for row in table.rows
        if row.error_max and reasons.get((row.stepper, row.dt)) != UNSTABLE
    ]
    resolution = table.rows[0].resolution
    lowest = min(errors, default=resolution) or 1.0
    if resolution and (len(errors) < len(table.rows) or resolution > 1e-3 * lowest):
        lowest = min(lowest, resolution)
    return lowest / 10.0, 10.0 * max(stable, default=10.0 * lowest)


def points(table: AccuracyTable, stepper: str) -> list[Point]:
    """The runs of a stepper, each with its mark and inside the axis."""
    low, high = limits(table)
    reasons = _reasons(table)

    def point(row: Row) -> Point:
        reason = reasons.get((stepper, row.dt))
        if row.status != "ok":
            return Point(row.dt, high, UNSOLVED if row.status == "unsolved" else DIVERGED)
        if reason == UNRESOLVED or not row.error_max:
            return Point(row.dt, max(row.resolution, low), UNRESOLVED)
        if row.error_max > high:
            return Point(row.dt, high, OFF_AXIS)
        return Point(row.dt, row.error_max, reason)

    return [point(row) for row in table.rows if row.stepper == stepper]


def _reasons(table: AccuracyTable) -> dict[tuple[str, float], str]:
    """Why a run was left out, by stepper and step size."""
    return {
        (each.stepper, point.dt): point.reason
        for each in table.orders
        for point in each.order.left_out
    }
