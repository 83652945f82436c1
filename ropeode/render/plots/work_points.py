"""Where the runs of a work-precision study stand in its picture, and what their marks mean."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ropeode.render.plots.point_markers import MARKS as OF_ORDERS
from ropeode.render.plots.point_markers import UNRESOLVED
from ropeode.study import INFINITE, Cost, Measure, WorkPrecision, WorkRow, check_axes

CERTIFIED = "ok"
BLEW_UP = "unstable, diverged or unsolved, at the upper edge"
STOPPED = "stopped at a limit, at the upper edge"
BELOW = "unresolved"
MARKS: dict[str, dict[str, Any]] = {
    BLEW_UP: {"marker": "x", "clip_on": False},
    STOPPED: {"marker": "|", "markersize": 9, "clip_on": False},
    BELOW: OF_ORDERS[UNRESOLVED],
}
# Room around the points, as a factor.
_AROUND, _ABOVE, _BELOW = 1.6, 4.0, 4.0

Ends = tuple[float, float]


class WorkPoint(NamedTuple):
    """One run in the picture.

    Fields:
        row: of the study.
        cost: where it stands.
        error: where it stands.
        mark: `CERTIFIED`, or a key of `MARKS`.
    """

    row: WorkRow
    cost: float
    error: float
    mark: str


def points_and_limits(
    study: WorkPrecision, cost: Cost, measure: Measure
) -> tuple[list[WorkPoint], Ends, Ends]:
    """The runs that have a cost, each with its mark and inside the axes; their ends."""
    resolution = check_axes(study, cost, measure)
    paid = [(row, float(value)) for row in study.rows if (value := _paid(study, row, cost))]
    known = [error for row, _ in paid if row.status == "ok" and (error := getattr(row, measure))]
    errors = [error for error in known if error < INFINITE]
    high = _ABOVE * max(errors, default=10.0 * resolution)
    seen = [*errors, resolution] if _near(resolution, errors) else errors
    low = min(seen, default=high / 100.0) / _BELOW
    costs = [value for _, value in paid] or [1.0]
    if cost == "seconds":
        costs += [end for row, _ in paid for end in (row.seconds_min, row.seconds_max) if end]
    points = [_point(row, value, measure, max(resolution, low), high) for row, value in paid]
    return points, _with_powers_of_ten(min(costs) / _AROUND, max(costs) * _AROUND), (low, high)


def _with_powers_of_ten(low: float, high: float) -> tuple[float, float]:
    """Wider limits, where there are no two powers of ten between them: the axis has no others."""
    first, last = math.log10(low), math.log10(high)
    if math.floor(last) - math.ceil(first) >= 1:
        return low, high
    return 10.0 ** math.floor(first), 10.0 ** math.ceil(last)


def _near(resolution: float, errors: Sequence[float]) -> bool:
    """Whether the axis should reach down to the resolution."""
    return resolution > 1e-3 * min(errors, default=resolution)


def _paid(study: WorkPrecision, row: WorkRow, cost: Cost) -> float | None:
    if row.status == "time limit" and cost == "seconds":
        return study.run_limit
    return getattr(row, cost)


def _point(row: WorkRow, cost: float, measure: Measure, low: float, high: float) -> WorkPoint:
    """Unresolved runs stand at `low`, and those without an error at `high`."""
    error = getattr(row, measure)
    if error == INFINITE or row.status in ("unstable", "diverged", "unsolved", "failed"):
        return WorkPoint(row, cost, high, BLEW_UP)
    if row.status != "ok":
        return WorkPoint(row, cost, high, STOPPED)
    if error is None:
        return WorkPoint(row, cost, low, BELOW)
    return WorkPoint(row, cost, error, CERTIFIED)


def front_line(study: WorkPrecision, cost: Cost, measure: Measure) -> tuple[np.ndarray, np.ndarray]:
    """Costs and errors of the Pareto front, from cheap to costly."""
    front = study.front(cost, measure)
    costs = np.array([getattr(row, cost) for row in front], float)
    return costs, np.array([getattr(row, measure) for row in front], float)
