"""Errors of runs as lines over time, above what can be resolved of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from ropeode.analysis import RESOLUTION_FACTOR
from ropeode.render.plots.overlaps import take_turns
from ropeode.render.plots.panels import Line, Panel
from ropeode.render.plots.style import BAND, BAND_EDGE
from ropeode.render.plots.time_axes import draw_ends

# Marks on each line, which stand at other times than those of the other lines.
_MARKS = 8
# A bound that is so many times smaller than nearly all errors is no part of the picture.
_FAR_BELOW, _FEW = 1e4, 0.01


class Error(NamedTuple):
    """The error of a run at times, both ``(times,)``."""

    times: np.ndarray
    values: np.ndarray


def draw_curves(
    panels: Sequence[tuple[Panel, Axes]],
    times: np.ndarray,
    bound: np.ndarray,
    errors: Mapping[int, Error],
    highest: float,
) -> bool:
    """Draw the lines of all panels on one logarithmic axis.

    Arguments:
        panels: with their axes.
        times: at which the truth is known, ``(times,)``.
        bound: its estimated error there, ``(times,)``.
        errors: of each curve, by its identity; those below zero have hollow marks.
        highest: an error above it is that of a run that has blown up.

    Returns:
        Whether lines lie on one another.
    """
    resolution = RESOLUTION_FACTOR * bound
    low, high = _limits(bound, [np.abs(each.values) for each in errors.values()], highest)
    shared = False
    for panel, axes in panels:
        axes.set(yscale="log", ylim=(low, high))
        axes.fill_between(times, 0.0, bound, color=BAND, linewidth=0, label="estimated bound")
        look = {"color": BAND_EDGE, "linewidth": 0.9, "linestyle": "--"}
        axes.plot(times, resolution, label="resolution (10 × bound)", **look)
        drawn = []
        for index, line in enumerate(panel.lines):
            error = errors[id(line.curve)]
            # What is out of sight is still a number that can be drawn.
            sizes = np.clip(np.abs(error.values), low, 10.0 * high)
            resolved = np.abs(error.values) >= resolution[: len(sizes)]
            if not np.all(resolved):
                look = {"color": "0.6", "linestyle": ":", "linewidth": 1.0, "zorder": 1.8}
                axes.plot(error.times, sizes, label="error below the resolution", **look)
            shown = np.where(resolved, sizes, np.nan)
            first = index / len(panel.lines)
            drawn += _draw_line(axes, line, error.times, shown, error.values < 0, first)
            draw_ends(axes, line, error.times, np.abs(error.values))
        shared |= take_turns(drawn)
    return shared


def _draw_line(
    axes: Axes, line: Line, times: np.ndarray, sizes: np.ndarray, less: np.ndarray, first: float
) -> list[Line2D]:
    """A line with some marks; `first` is the part of the way between two at which they begin."""
    known = np.append(np.isfinite(sizes), False)
    alone = np.flatnonzero(known[:-1] & ~known[1:] & ~np.roll(known, 1)[:-1])
    drawn = axes.plot(
        times, sizes, color=line.colour, label=line.label, marker=".", markevery=list(alone)
    )
    step = max(1, len(sizes) // _MARKS)
    marked = np.arange(len(sizes))[int(first * step) :: step]
    for some, face in ((marked[~less[marked]], line.colour), (marked[less[marked]], "white")):
        look = {"markersize": 3.5, "markerfacecolor": face, "markeredgewidth": 0.8}
        axes.plot(
            times[some],
            sizes[some],
            linestyle="none",
            color=line.colour,
            marker=line.marker,
            **look,
        )
    return drawn


def _limits(bound: np.ndarray, sizes: Sequence[np.ndarray], highest: float) -> tuple[float, float]:
    """The ends of the axis.

    A run that blew up does not stretch it, nor does a bound far below all errors.
    """
    errors = np.concatenate([bound[:0], *(each[each > 0] for each in sizes)])
    stable = errors[errors <= highest]
    low = min(bound[bound > 0], default=1e-16)
    if len(errors) and _FAR_BELOW * np.max(bound, initial=0.0) < np.quantile(errors, _FEW):
        low = np.quantile(errors, _FEW)
    largest = max(np.max(stable, initial=0.0), RESOLUTION_FACTOR * np.max(bound, initial=0.0), low)
    return low / 10.0, 10.0 * largest
