"""Marks of plots against time: where trust ends, and where a run leaves the axes."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from ropeode.references import Reference
from ropeode.render.plots.panels import Line

_MARK = {"linestyle": "none", "markersize": 6}
# Of runs that ended early, by their status: the marker and its name.
_ENDS = {"diverged": ("X", "diverged"), "unsolved": ("P", "unsolved")}


def draw_horizon(axes: Axes, reference: Reference) -> None:
    """A vertical line where the trust in the reference ends, if it does."""
    if reference.horizon is not None:
        axes.axvline(
            reference.horizon,
            color="0.3",
            linewidth=1.0,
            linestyle="-.",
            label=f"trusted before t = {reference.horizon:g}:\n"
            f"{reference.certificate.horizon_reason}",
        )


def draw_ends(axes: Axes, line: Line, times: np.ndarray, values: np.ndarray) -> None:
    """Marks at the upper edge where a line first leaves the axes, and where the run ended.

    Arguments:
        axes: with their limits set.
        line: whose ends.
        times: of its numbers, ``(times,)``.
        values: its numbers, ``(times,)``.
    """
    _, high = axes.get_ylim()
    if len(above := np.flatnonzero(values > high)):
        _mark(axes, float(times[above[0]]), high, line.colour, "^", "above this axis")
    if line.curve.diverged_at is not None:
        _mark(axes, line.curve.diverged_at, high, line.colour, *_ENDS[line.curve.status])


def _mark(axes: Axes, time: float, edge: float, colour: str, marker: str, label: str) -> None:
    axes.plot(time, edge, color=colour, marker=marker, clip_on=False, zorder=3, **_MARK)
    axes.plot([], [], color="0.4", marker=marker, label=label, **_MARK)
