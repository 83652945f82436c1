"""Error against step size: the accuracy table as a picture."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import matplotlib
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import LogFormatterSciNotation, LogLocator, NullFormatter

from ropeode.render import table_words
from ropeode.render.plots.labels import with_unit
from ropeode.render.plots.overlaps import TURNS, moved_right, side_by_side, take_turns
from ropeode.render.plots.point_markers import MARKS, Point, in_legend, limits, points
from ropeode.render.plots.style import (
    BAND,
    BAND_EDGE,
    PREDICTED,
    PREDICTION,
    STYLE,
    draw_legends,
    new_figure,
    stepper_style,
)
from ropeode.study import AccuracyTable, StepperOrder
from ropeode.validation import bad_value, check_kind

_AXES_HEIGHT = 3.8
_DENSE = 40
# Over a shorter range, step sizes between powers of ten are labelled too.
_FEW_DECADES = 50.0
# Of the triangles that show slopes, in parts of the axes' width and height.
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


@matplotlib.rc_context(STYLE)
def plot_convergence(table: AccuracyTable, *, ax: Axes | None = None) -> Figure:
    """Error against step size, with the fitted orders and what was left out of them.

    Arguments:
        table: from `ropeode.accuracy_table`, or from `ropeode.trajectory_errors`.
        ax: empty axes of a figure of yours to draw in; by default those of a new figure.

    Returns:
        The matplotlib figure. A new one is 6.5 inches wide, with one pair of logarithmic axes:
        step size in the problem's unit of time, `error_max` in that of the norm.
        docs/howto/plots.md says what each mark means.

    Examples:
        >>> from ropeode import Rope, accuracy_table, plot_convergence
        >>> table = accuracy_table(Rope(num_nodes=4).problem(frames=3), ["rk4"], [16, 32, 64])
        >>> plot_convergence(table).axes[0].get_xlabel()
        'step size dt [frames]'
    """
    check_kind("table", table, AccuracyTable, "accuracy_table")
    if ax is not None and not isinstance(ax, Axes):
        raise bad_value("ax", ax, "axes of matplotlib", "for example figure.subplots()")
    drawn = {each.stepper: points(table, each.stepper) for each in table.orders}
    shown = [mark for mark in MARKS if any(p.mark == mark for each in drawn.values() for p in each)]
    title = f"Error against step size: {table_words.problem_words(table.problem)}"
    if ax is None:
        # Below the axes; the height is set once the legends are known.
        figure = new_figure(title, table_words.error_words(table).rstrip("."), _AXES_HEIGHT)
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
    if max(dts) < _FEW_DECADES * min(dts):
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        everywhere = (np.inf, np.inf)
        axes.xaxis.set_major_formatter(LogFormatterSciNotation(minor_thresholds=everywhere))
    axes.xaxis.set_minor_formatter(NullFormatter())
    resolution = table.rows[0].resolution
    axes.axhspan(0.0, resolution, color=BAND, linewidth=0, zorder=0.5)
    axes.axhline(resolution, color=BAND_EDGE, linewidth=0.8, zorder=0.6)
    marks = _draw_points(axes, drawn)
    fits = [_fit(each, drawn[each.stepper]) for each in table.orders]
    shared = take_turns(_draw_fits(axes, fits))
    take_turns(_draw_predictions(axes, table))
    lines = [line for line in fits if line is not None]
    taken = np.concatenate([marks, *map(_dense, lines)])
    draw_triangles(axes, lines, taken, max(resolution, axes.get_ylim()[0]))
    steppers, meanings = _legends(table, shown, shared)
    if ax is None:
        draw_legends(figure, _AXES_HEIGHT, steppers, meanings)
    else:
        axes.legend(handles=[*steppers, *meanings], fontsize=6.5, frameon=True)
    return figure


def _dense(line: FittedLine) -> np.ndarray:
    """Points ``(points, 2)`` all along a line, which is straight in logarithms."""
    start, end = np.log([(line.dts[i], line.errors[i]) for i in (0, -1)])
    return np.exp(np.linspace(start, end, _DENSE))


def _draw_points(axes: Axes, drawn: Mapping[str, Sequence[Point]]) -> np.ndarray:
    """The mark of each run, side by side where they would hide one another.

    Returns:
        Where the marks are, ``(marks, 2)``.
    """
    every = [(i, point) for i, own in enumerate(drawn.values()) for point in own]
    at = np.array([(point.dt, point.error) for _, point in every])
    for (index, point), to_the_right in zip(every, side_by_side(axes, at), strict=True):
        colour, marker = stepper_style(index)
        form = {"marker": marker, "zorder": 2.5} if point.mark is None else MARKS[point.mark]
        place = moved_right(axes, to_the_right)
        look = {"zorder": 3, "linestyle": "none", "color": colour, "transform": place}
        axes.plot(point.dt, point.error, **{**look, **form})
    return at


def _fit(each: StepperOrder, drawn: Sequence[Point]) -> FittedLine | None:
    """The fitted line, if there is one."""
    slope, used = each.order.observed, [point for point in drawn if point.mark is None]
    if slope is None or not used:
        return None
    # A least-squares line goes through the mean of its points.
    log_dt, log_error = np.log([(point.dt, point.error) for point in used]).T
    order = np.argsort(log_dt)
    fitted = np.exp(np.mean(log_error) + slope * (log_dt - np.mean(log_dt)))[order]
    return FittedLine(slope, np.exp(log_dt)[order], fitted)


def _draw_fits(axes: Axes, fits: Sequence[FittedLine | None]) -> list[Line2D]:
    return [
        axes.plot(fit.dts, fit.errors, color=stepper_style(i)[0], linewidth=1.0, zorder=1.9)[0]
        for i, fit in enumerate(fits)
        if fit is not None
    ]


def _draw_predictions(axes: Axes, table: AccuracyTable) -> list[Line2D]:
    """The lines ``C dt^p`` of theory, over all step sizes, where there are any."""
    lines = []
    for index, each in enumerate(table.orders):
        constant = each.constant
        if constant is not None and constant.predicted is not None and constant.order is not None:
            dts = np.array(axes.get_xlim())
            line = constant.predicted * dts**constant.order
            look = {"color": stepper_style(index)[0], "zorder": 1.85, **PREDICTION}
            lines += axes.plot(dts, line, **look)
    return lines


def _legends(
    table: AccuracyTable, shown: Sequence[str], shared: bool
) -> tuple[list[Artist], list[Artist]]:
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
    if shared:
        marks.append(Line2D([], [], color="0.3", linestyle=(0, (3, 3)), label=TURNS))
    resolution = table.rows[0].resolution
    words = f"unresolved: below {resolution:.1e},\n10 × the reference's bound"
    marks.append(Patch(facecolor=BAND, edgecolor=BAND_EDGE, label=words))
    return steppers, marks


def _order_words(each: StepperOrder) -> str:
    order = each.order
    other = "" if each.solves else "; solves another problem"
    if order.observed is None:
        return f"{each.stepper}: {order.verdict}{other}"
    words = "order" if order.verdict == "converges" else f"{order.verdict}, slope"
    return (
        f"{each.stepper}: {words} {order.observed:.3f} {table_words.order_interval(order)}{other}"
    )


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
    to_axes = axes.transScale + axes.transLimits
    taken = to_axes.transform(points)
    lowest = to_axes.transform((points[0, 0], floor))[1]
    decade = to_axes.transform((10.0, 10.0)) - to_axes.transform((1.0, 1.0))
    for order in sorted({order for line in lines if (order := round(line.slope)) > 0}):
        own = [line for line in lines if round(line.slope) == order]
        rise = order * _LEG * decade[1] / decade[0]
        places = [
            (_clearance(corners, taken), corners)
            for line in own
            for corners in _places(to_axes.transform(np.stack([line.dts, line.errors], 1)), rise)
            if corners[:, 0].min() > _EDGE and corners[:, 0].max() < 1 - 2 * _EDGE
            if lowest + _EDGE < corners[:, 1].min() and corners[:, 1].max() < 1 - _EDGE
        ]
        if places:
            corners = max(places, key=lambda each: each[0])[1]
            taken = np.concatenate([taken, corners])
            _draw(axes, corners, order)


def _places(ends: np.ndarray, rise: float) -> Iterable[np.ndarray]:
    """Corners ``(3, 2)``, the right angle in the middle, on both sides along a line."""
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
