"""What would hide something else: lines that coincide take turns, marks stand side by side."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.transforms import ScaledTranslation, Transform
from scipy.sparse.csgraph import connected_components

# In points, of which an inch has 72: nearer lines hide one another, and marks.
_LINES_NEAR, _MARKS_NEAR = 1.5, 4.5
# Lines hide one another that are so near over this part of the shorter one.
_SHARED = 0.25
# The length of a dash, which is shorter the more lines there are.
_DASH, _SHORTEST_DASH = 12.0, 3.0
_SAMPLES = 400
# Marks side by side fill no more than this part of the way to the next step size.
_FILLED = 0.8
TURNS = "striped: several lines in one place"


def take_turns(lines: Sequence[Line2D]) -> bool:
    """Dash lines that lie on one another, so that each shows through the gaps of the others.

    Arguments:
        lines: drawn in one pair of axes, whose limits are set, from left to right.

    Returns:
        Whether any two lie on one another.
    """
    # Of a single frame there may be a single point.
    lines = [line for line in lines if len(_points(line)) > 1]
    if len(lines) < 2:
        return False
    paths = [_points(line) for line in lines]
    ends = [finite[[0, -1], 0] for finite in paths]
    across = np.linspace(np.min(ends), np.max(ends), _SAMPLES)
    outside = (np.nan, np.nan)
    heights = np.array([np.interp(across, each[:, 0], each[:, 1], *outside) for each in paths])
    # Behind the edge of the axes nothing hides anything.
    low, high = _edges(lines[0])
    heights[(heights < low) | (heights > high)] = np.nan
    # Of steep lines the distance counts, not the height.
    steepness = np.hypot(1.0, np.gradient(heights, across, axis=1))
    near = np.abs(heights[:, None] - heights) <= _LINES_NEAR * steepness
    lengths = np.sum(np.isfinite(heights), axis=1)
    shared = np.sum(near, axis=2) > _SHARED * np.minimum.outer(lengths, lengths)
    count, group_of = connected_components(shared, directed=False)
    for group in range(count):
        members = np.flatnonzero(group_of == group)
        if len(members) > 1:
            # The one that is alone most often stays whole, below the others.
            hidden = np.sum(near[np.ix_(members, members)], axis=(1, 2)) / lengths[members]
            order = members[np.argsort(hidden, kind="stable")]
            _dash([lines[i] for i in order], [paths[i] for i in order])
    return count < len(lines)


def _dash(lines: Sequence[Line2D], paths: Sequence[np.ndarray]) -> None:
    first = paths[0]
    along = np.append(0.0, np.cumsum(np.hypot(*np.diff(first, axis=0).T)))
    dash = max(_DASH / len(lines), _SHORTEST_DASH)
    period = len(lines) * dash
    for turn, (line, path) in enumerate(zip(lines, paths, strict=True)):
        if turn == 0:
            line.set_zorder(line.get_zorder() - 0.05)
            continue
        begin = float(np.interp(path[0, 0], first[:, 0], along))
        # Matplotlib multiplies dashes by the width of the line.
        offset, on, off = (
            length / line.get_linewidth()
            for length in ((begin - turn * dash) % period, dash, period - dash)
        )
        line.set_linestyle((offset, (on, off)))


def _edges(line: Line2D) -> tuple[float, float]:
    """The lower and the upper edge of its axes, in points."""
    assert isinstance(line.axes, Axes)
    (_, low), (_, high) = line.axes.bbox.get_points() * 72.0 / line.axes.figure.dpi
    return low, high


def _points(line: Line2D) -> np.ndarray:
    """The finite points of a line on its axes, ``(points, 2)``, in points of 1/72 inch."""
    axes = line.axes
    assert isinstance(axes, Axes)
    data = np.asarray(line.get_xydata(), float)
    data = data[np.all(np.isfinite(data), axis=1)]
    return _in_points(axes, data) if len(data) else data


def _in_points(axes: Axes, data: np.ndarray) -> np.ndarray:
    figure = axes.get_figure(root=True)
    assert figure is not None
    return axes.transData.transform(data) * 72.0 / figure.dpi


def side_by_side(axes: Axes, marks: np.ndarray) -> np.ndarray:
    """How far to the right marks are moved so that none hides another one at the same x.

    Arguments:
        axes: with their limits set.
        marks: where they are, ``(marks, 2)``.

    Returns:
        Lengths in points of 1/72 inch, ``(marks,)``.
    """
    at = _in_points(axes, marks)
    columns = np.unique(marks[:, 0])
    places = np.unique(at[:, 0])
    room = _FILLED * float(np.min(np.diff(places), initial=np.inf))
    moved = np.zeros(len(marks))
    for column in columns:
        own = np.flatnonzero(marks[:, 0] == column)
        own = own[np.argsort(at[own, 1], kind="stable")]
        breaks = np.flatnonzero(np.diff(at[own, 1]) > _MARKS_NEAR) + 1
        for group in np.split(own, breaks):
            if len(group) > 1:
                step = min(_MARKS_NEAR + 1.0, room / len(group))
                moved[np.sort(group)] = step * (np.arange(len(group)) - (len(group) - 1) / 2)
    return moved


def moved_right(axes: Axes, length: float) -> Transform:
    """The data's coordinates, moved on paper by so many points of 1/72 inch."""
    figure = axes.get_figure(root=True)
    assert figure is not None
    return axes.transData + ScaledTranslation(length / 72.0, 0.0, figure.dpi_scale_trans)
