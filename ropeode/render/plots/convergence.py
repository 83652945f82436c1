"""Error against step size: the accuracy table as a picture."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ropeode.render import table_words
from ropeode.render.plots.labels import with_unit
from ropeode.render.plots.point_markers import MARKS, Point, in_legend, limits, points
from ropeode.render.plots.style import (
    BAND,
    BAND_EDGE,
    PREDICTED,
    PREDICTION,
    STYLE,
    new_figure,
    stepper_style,
)
from ropeode.render.plots.triangles import FittedLine, draw_triangles
from ropeode.study.accuracy_table import AccuracyTable, StepperOrder

_AXES_HEIGHT = 3.8
_LEGEND_LINE = 0.17
_DENSE = 40


@matplotlib.rc_context(STYLE)
def plot_convergence(table: AccuracyTable, *, ax: Axes | None = None) -> Figure:
    """Error against step size, with the fitted orders and what was left out of them.

    Arguments:
        table: from `ropeode.accuracy_table`, or from `ropeode.trajectory_errors`.
        ax: empty axes of a figure of yours to draw in; by default those of a new figure.

    Returns:
        The matplotlib figure. A new one is 6.5 inches wide, with one pair of logarithmic axes:
        step size in the problem's unit of time, `error_max` in that of the norm. docs/plots.md
        says what each mark means.
    """
    drawn = {each.stepper: points(table, each.stepper) for each in table.orders}
    shown = [mark for mark in MARKS if any(p.mark == mark for each in drawn.values() for p in each)]
    title = f"Error against step size: {table_words.problem_words(table.problem)}"
    if ax is None:
        height = _AXES_HEIGHT + _LEGEND_LINE * max(len(drawn), len(shown) + 2)
        figure = new_figure(title, table_words.error_words(table).rstrip("."), height)
        axes = figure.subplots()
    else:
        found, axes = ax.get_figure(root=True), ax
        assert found is not None
        figure = found
        axes.set_title(title, parse_math=False, wrap=True)
    dts = [row.dt for row in table.rows]
    axes.set(
        xscale="log",
        yscale="log",
        xlim=(min(dts) / 1.5, max(dts) * 1.5),
        ylim=limits(table),
        xlabel=with_unit("step size dt", table.problem, "time"),
        ylabel=with_unit("max error", table.problem, table.norm.quantity),
    )
    _draw_band(axes, table.rows[0].resolution)
    lines = []
    for index, each in enumerate(table.orders):
        lines += _draw_stepper(axes, index, each, drawn[each.stepper])
        _draw_prediction(axes, index, each)
    taken = [np.array([(p.dt, p.error) for p in each]) for each in drawn.values()]
    taken += [_dense(line) for line in lines]
    floor = max(table.rows[0].resolution, axes.get_ylim()[0])
    draw_triangles(axes, lines, np.concatenate(taken), floor)
    steppers, marks = _legends(table, shown)
    if ax is None:
        figure.legend(handles=steppers, loc="outside lower left")
        figure.legend(handles=marks, loc="outside lower right")
    else:
        axes.legend(handles=[*steppers, *marks])
    return figure


def _dense(line: FittedLine) -> np.ndarray:
    """Points ``(points, 2)`` all along a line, which is straight in logarithms."""
    start, end = np.log([(line.dts[i], line.errors[i]) for i in (0, -1)])
    return np.exp(np.linspace(start, end, _DENSE))


def _draw_band(axes: Axes, resolution: float) -> None:
    """The errors that the reference cannot resolve."""
    low, _ = axes.get_ylim()
    axes.axhspan(0.0, resolution, color=BAND, linewidth=0, zorder=0.5)
    axes.axhline(resolution, color=BAND_EDGE, linewidth=0.8, zorder=0.6)
    where = "" if resolution >= low else ", below this axis"
    axes.text(
        0.99,
        0.015,
        f"resolution {resolution:.1e} (10 × the reference's bound){where}",
        transform=axes.transAxes,
        ha="right",
        va="bottom",
        fontsize=7.5,
        color="0.25",
    )


def _draw_stepper(
    axes: Axes, index: int, each: StepperOrder, drawn: Sequence[Point]
) -> list[FittedLine]:
    """A stepper's points, and the fitted line if there is one."""
    colour, marker = stepper_style(index)
    for mark, form in MARKS.items():
        if left_out := [point for point in drawn if point.mark == mark]:
            _scatter(axes, left_out, color=colour, zorder=3, **form)
    used = [point for point in drawn if point.mark is None]
    if not used:
        return []
    _scatter(axes, used, color=colour, zorder=2.5, marker=marker)
    slope = each.order.observed
    if slope is None:
        return []
    # A least-squares line goes through the mean of its points.
    log_dt, log_error = np.log([(point.dt, point.error) for point in used]).T
    order = np.argsort(log_dt)
    fitted = np.exp(np.mean(log_error) + slope * (log_dt - np.mean(log_dt)))[order]
    line = FittedLine(slope, np.exp(log_dt)[order], fitted)
    axes.plot(line.dts, line.errors, color=colour, linewidth=1.0, zorder=1.9)
    return [line]


def _draw_prediction(axes: Axes, index: int, each: StepperOrder) -> None:
    """The line ``C dt^p`` of theory, over all step sizes, where there is one."""
    constant = each.constant
    if constant is not None and constant.predicted is not None and constant.order is not None:
        dts = np.array(axes.get_xlim())
        line = constant.predicted * dts**constant.order
        axes.plot(dts, line, color=stepper_style(index)[0], zorder=1.85, **PREDICTION)


def _scatter(axes: Axes, drawn: Sequence[Point], **form: Any) -> None:
    axes.plot(
        [point.dt for point in drawn],
        [point.error for point in drawn],
        linestyle="none",
        **form,
    )


def _legends(table: AccuracyTable, shown: Sequence[str]) -> tuple[list[Artist], list[Artist]]:
    """The steppers with their orders, and what the marks mean."""
    steppers: list[Artist] = [
        Line2D([], [], color=stepper_style(i)[0], marker=stepper_style(i)[1],
               label=_order_words(each))
        for i, each in enumerate(table.orders)
    ]  # fmt: skip
    marks: list[Artist] = [
        Line2D([], [], color="0.3", linestyle="none", label=mark, **in_legend(mark))
        for mark in shown
    ]
    if any(each.order.used for each in table.orders):
        words = "filled: used for the order's line"
        marks.insert(0, Line2D([], [], color="0.3", marker="o", label=words))
    if any(each.constant and each.constant.predicted for each in table.orders):
        marks.append(Line2D([], [], color="0.3", label=PREDICTED, **PREDICTION))
    return steppers, marks


def _order_words(each: StepperOrder) -> str:
    order = each.order
    other = "" if each.solves else "; solves another problem"
    if order.observed is None:
        return f"{each.stepper}: {order.verdict}{other}"
    words = "order" if order.verdict == "converges" else f"{order.verdict}, slope"
    return f"{each.stepper}: {words} {order.observed:.3f} {table_words.interval(order)}{other}"
