"""Panels: how curves are divided among axes, so that they stay readable."""

from __future__ import annotations

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

from ropeode.problems import Problem
from ropeode.render.plots.labels import with_unit
from ropeode.render.plots.overlaps import TURNS
from ropeode.render.plots.style import (
    FIGURE_WIDTH,
    make_room,
    new_figure,
    new_grid,
    stepper_style,
    wrapped,
)
from ropeode.render.table_words import problem_words
from ropeode.study import Curve

_TWO_COLUMNS_UP_TO = 6
_TITLE_HEIGHT, _ROW_HEIGHT = 0.6, 1.6
_ALONE_HEIGHT = 3.3
_LABEL_WIDTH = 0.4
_TICKS = 6


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
