"""Errors and energies against time: lines in panels, above what can be resolved of them."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import NamedTuple

import matplotlib
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from ropeode.analysis import RESOLUTION_FACTOR
from ropeode.problems import Problem
from ropeode.references import Reference
from ropeode.render.plots.labels import with_unit
from ropeode.render.plots.overlaps import TURNS, take_turns
from ropeode.render.plots.style import (
    BAND,
    BAND_EDGE,
    FIGURE_WIDTH,
    PREDICTED,
    PREDICTION,
    STYLE,
    make_room,
    new_figure,
    new_grid,
    stepper_style,
    wrapped,
)
from ropeode.render.table_words import problem_words
from ropeode.study import Curve, EnergyCurves, ErrorCurves
from ropeode.validation import check_kind

# Times the motion; an error above it is that of a run that has blown up.
_HIGHEST = 10.0
_TWO_COLUMNS_UP_TO = 6
_TITLE_HEIGHT, _ROW_HEIGHT = 0.6, 1.6
_ALONE_HEIGHT = 3.3
_LABEL_WIDTH = 0.4
_TICKS = 6
# Marks on each line, which stand at other times than those of the other lines.
_MARKS = 8
# A bound that is so many times smaller than nearly all errors is no part of the picture.
_FAR_BELOW, _FEW = 1e4, 0.01
_MARK = {"linestyle": "none", "markersize": 6}
# Of runs that ended early, by their status: the marker and its name.
_ENDS = {"diverged": ("X", "diverged"), "unsolved": ("P", "unsolved")}
_LESS = Line2D(
    [], [], color="0.3", linestyle="none", marker="o", markersize=3.5, markerfacecolor="white",
    label="hollow: less energy than the true one",
)  # fmt: skip


@matplotlib.rc_context(STYLE)
def plot_errors(curves: ErrorCurves) -> Figure:
    """Error against time for each run, with what the reference can resolve.

    Arguments:
        curves: from `ropeode.error_curves`.

    Returns:
        A matplotlib figure, 6.5 inches wide, with a panel for each stepper, or a single one
        where there is one number of steps per frame; time in the problem's unit, errors
        (logarithmic) in that of the norm. docs/howto/plots.md says what each mark means.

    Examples:
        >>> from ropeode import Rope, error_curves, plot_errors
        >>> curves = error_curves(Rope(num_nodes=4).problem(frames=3), ["rk4"], [16, 64])
        >>> plot_errors(curves).axes[0].get_ylabel()
        'error [length units]'
    """
    check_kind("curves", curves, ErrorCurves, "error_curves")
    label = with_unit("error", curves.problem, curves.norm.quantity)
    figure, panels = new_panels(
        curves.problem, curves.curves, "Error", f"Error: {curves.norm.words}", label
    )
    shared = draw_curves(panels, curves.times, curves.bound, _HIGHEST * curves.motion)
    for panel, axes in panels:
        draw_horizon(axes, curves.reference)
        for line in panel.lines:
            if (predicted := line.curve.predicted) is not None:
                # Above the measured one, which it would else hide behind.
                look = {"color": "0.1", "zorder": 3, **PREDICTION}
                axes.plot(curves.times, predicted, label=PREDICTED, **look)
    draw_legend(figure, panels, shared)
    return figure


@matplotlib.rc_context(STYLE)
def plot_energies(curves: EnergyCurves) -> Figure:
    """How far the energy of each run is from the true one, against time.

    Arguments:
        curves: from `ropeode.energy_curves`.

    Returns:
        A matplotlib figure, 6.5 inches wide, with a panel for each stepper, or a single one
        where there is one number of steps per frame; time and energy (logarithmic) in the
        problem's units. docs/howto/plots.md says what each mark means.

    Examples:
        >>> from ropeode import Rope, energy_curves, plot_energies
        >>> curves = energy_curves(Rope(num_nodes=4).problem(frames=3), ["rk4"], [16])
        >>> plot_energies(curves).axes[0].get_xlabel()
        'time [frames]'
    """
    check_kind("curves", curves, EnergyCurves, "energy_curves")
    label = with_unit(r"$|E - E_{\rm true}|$", curves.problem, "energy")
    # At the first sample, each error is zero by definition.
    after = slice(1, None)
    errors = [
        dataclasses.replace(each, times=each.times[: len(found)][after], values=found[after])
        for each in curves.curves
        for found in [curves.errors(each)]
    ]
    figure, panels = new_panels(curves.problem, errors, "Energy error", _true_energy(curves), label)
    size = float(np.max(np.abs(curves.values))) or np.inf
    shared = draw_curves(panels, curves.times[after], curves.bound[after], size)
    if curves.reference is not None and not curves.conserved:
        for _, axes in panels:
            draw_horizon(axes, curves.reference)
    signs = any(np.any(each.values < 0) for each in errors)
    draw_legend(figure, panels, shared, [_LESS] if signs else [])
    return figure


def _true_energy(curves: EnergyCurves) -> str:
    start, end = curves.values[0], curves.values[-1]
    if curves.conserved:
        return f"true energy: {start:.4g} at all times; conserved wherever looked at"
    return f"true energy: that of the reference, {start:.4g} at first and {end:.4g} at last"


class Line(NamedTuple):
    """A curve and how its panel shows it."""

    curve: Curve
    colour: str
    marker: str
    label: str


class Panel(NamedTuple):
    """One pair of axes; `title` names its stepper, and is empty where there is one panel."""

    title: str
    lines: tuple[Line, ...]


def panels_of(curves: Sequence[Curve]) -> list[Panel]:
    """All curves in one panel where each stepper has one; else a panel for each stepper.

    In one panel the colour stands for the stepper; in several for the step size, dark for
    large and light for small, with the same colours in all.
    """
    steppers = list(dict.fromkeys(curve.stepper for curve in curves))
    if len(steppers) == len(curves):
        lines = (
            Line(curve, *stepper_style(i), f"{curve.stepper}, {curve.label}")
            for i, curve in enumerate(curves)
        )
        return [Panel("", tuple(lines))]
    dts = sorted({curve.dt for curve in curves}, reverse=True)
    # The end of the scale is too pale for lines on white.
    shades = matplotlib.colormaps["viridis"](np.linspace(0.0, 0.88, len(dts)))
    colours = dict(zip(dts, map(to_hex, shades), strict=True))
    return [
        Panel(
            name,
            tuple(
                Line(curve, colours[curve.dt], "o", curve.label)
                for curve in curves
                if curve.stepper == name
            ),
        )
        for name in steppers
    ]


def new_panels(
    problem: Problem, curves: Sequence[Curve], title: str, more: str, y: str
) -> tuple[Figure, list[tuple[Panel, Axes]]]:
    """A figure with axes for each panel, all of the same limits, over the time of the problem.

    Arguments:
        problem: of the curves.
        curves: to be drawn.
        title: of the figure, before the words for the problem.
        more: below the title.
        y: label of the upright axes.
    """
    panels = panels_of(curves)
    many = len(panels)
    columns = 1 if many == 1 else 2 if many <= _TWO_COLUMNS_UP_TO else 3
    rows = math.ceil(many / columns)
    height = _ALONE_HEIGHT if many == 1 else _TITLE_HEIGHT + _ROW_HEIGHT * rows
    title = f"{title} against time: {problem_words(problem)}"
    figure = new_figure(title, more, height)
    labels = with_unit("time", problem, "time"), y
    grid = new_grid(figure, rows, columns, many, labels)
    for axes, panel in zip(grid, panels, strict=True):
        axes.set_title(
            wrapped(panel.title, width=FIGURE_WIDTH / columns - _LABEL_WIDTH), loc="left"
        )
    grid[0].set_xlim(problem.ts[0], problem.ts[-1])
    grid[0].xaxis.set_major_locator(MaxNLocator(_TICKS, steps=[1, 2, 5, 10]))
    return figure, list(zip(panels, grid, strict=True))


def draw_legend(
    figure: Figure,
    panels: Sequence[tuple[Panel, Axes]],
    shared: bool,
    more: Sequence[Line2D] = (),
) -> None:
    """One legend for all panels, below them; each label once, the runs first.

    Arguments:
        figure: of the panels.
        panels: with their axes.
        shared: whether lines lie on one another.
        more: handles besides those that are drawn.
    """
    lines = sorted((line for panel, _ in panels for line in panel.lines), key=lambda e: -e.curve.dt)
    handles: dict[str, Artist] = {
        line.label: Line2D([], [], color=line.colour, marker=line.marker, markersize=3.5)
        for line in lines
    }
    for _, axes in panels:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    handles |= {str(each.get_label()): each for each in more}
    if shared:
        handles[TURNS] = Line2D([], [], color="0.3", linestyle=(0, (3, 3)))
    longest = max(len(line) for label in handles for line in label.splitlines())
    columns = 4 if longest < 22 else 3 if longest < 34 else 2 if longest < 60 else 1
    figure.legend(list(handles.values()), list(handles), loc="outside lower center", ncols=columns)
    make_room(figure, figure.get_figheight(), math.ceil(len(handles) / columns))


def draw_curves(
    panels: Sequence[tuple[Panel, Axes]],
    times: np.ndarray,
    bound: np.ndarray,
    highest: float,
) -> bool:
    """Draw the lines of all panels on one logarithmic axis.

    Arguments:
        panels: of errors, with their axes; those below zero have hollow marks.
        times: at which the truth is known, ``(times,)``.
        bound: its estimated error there, ``(times,)``.
        highest: an error above it is that of a run that has blown up.

    Returns:
        Whether lines lie on one another.
    """
    resolution = RESOLUTION_FACTOR * bound
    every = [np.abs(line.curve.values) for panel, _ in panels for line in panel.lines]
    low, high = _limits(bound, every, highest)
    shared = False
    for panel, axes in panels:
        axes.set(yscale="log", ylim=(low, high))
        axes.fill_between(times, 0.0, bound, color=BAND, linewidth=0, label="estimated bound")
        look = {"color": BAND_EDGE, "linewidth": 0.9, "linestyle": "--"}
        axes.plot(times, resolution, label="resolution (10 × bound)", **look)
        drawn = []
        for index, line in enumerate(panel.lines):
            error = line.curve
            # What is out of sight is still a number that can be drawn.
            sizes = np.clip(np.abs(error.values), low, 10.0 * high)
            resolved = np.abs(error.values) >= resolution[: len(sizes)]
            if not np.all(resolved):
                look = {"color": "0.6", "linestyle": ":", "linewidth": 1.0, "zorder": 1.8}
                axes.plot(error.times, sizes, label="error below the resolution", **look)
            shown = np.where(resolved, sizes, np.nan)
            first = index / len(panel.lines)
            drawn += _draw_line(axes, line, shown, first)
            _draw_ends(axes, line)
        shared |= take_turns(drawn)
    return shared


def _draw_line(axes: Axes, line: Line, sizes: np.ndarray, first: float) -> list[Line2D]:
    """A line with some marks; `first` is the part of the way between two at which they begin."""
    times, less = line.curve.times, line.curve.values < 0
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


def _draw_ends(axes: Axes, line: Line) -> None:
    """Marks at the upper edge where a line first leaves the axes, and where the run ended."""
    times, values = line.curve.times, np.abs(line.curve.values)
    _, high = axes.get_ylim()
    if len(above := np.flatnonzero(values > high)):
        _mark(axes, float(times[above[0]]), high, line.colour, "^", "above this axis")
    if line.curve.diverged_at is not None:
        _mark(axes, line.curve.diverged_at, high, line.colour, *_ENDS[line.curve.status])


def _mark(axes: Axes, time: float, edge: float, colour: str, marker: str, label: str) -> None:
    axes.plot(time, edge, color=colour, marker=marker, clip_on=False, zorder=3, **_MARK)
    axes.plot([], [], color="0.4", marker=marker, label=label, **_MARK)
