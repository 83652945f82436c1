"""One column of a sweep over two of its inputs, as a map of coloured cells."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

from ropeode.errors import InputError
from ropeode.render.plots.style import STYLE, WIDTH, new_figure, new_grid, wrapped
from ropeode.sweep.design.columns import COLUMNS, INPUTS
from ropeode.sweep.storage.load import load_sweep
from ropeode.validation import bad_value, unknown

if TYPE_CHECKING:
    import pandas as pd

# A DataFrame or one of its columns; the types that pandas declares are too wide for a checker.
Frame = Any

_COLOURS = "viridis"
_PANEL_HEIGHT = 2.3
_ALONE_HEIGHT = 3.6
_LEGEND_HEIGHT = 0.9
_MOST_TICKS = 9
# Values that span more than this are coloured by their logarithms.
_LOG_FROM = 100.0
# Steps between values count as equal if they differ by no more than this factor.
_EQUAL_WITHIN = 4.0
# If a smaller part of the cells has a row, rows are drawn as points.
_LEAST_FILLED = 0.25
# In a message.
_MOST_LISTED = 20
NOT_COMPUTED = "not computed yet"
# Patterns of cells and markers of points without a number, by reason.
_HATCHES = ("////", "....", "\\\\\\\\", "xxxx", "----", "oo", "++", "||||")
_MARKERS = ("x", "+", "1", "2", "3", "4", "|", "_")


class Axis(NamedTuple):
    """The values of an input along an axis.

    Fields:
        name: of the input.
        values: sorted.
        scale: `log` or `linear`, or `words` for equal steps from value to value.
        edges: of the cells, one more than there are values.
    """

    name: str
    values: list[Any]
    scale: str
    edges: np.ndarray

    def places(self, panel: Panel) -> list[int]:
        """The index of each row's value."""
        return [self.values.index(value) for value in panel.rows[self.name]]


class Panel(NamedTuple):
    """The rows of one stepper, or all of them.

    Fields:
        title: names the stepper; empty where there is one panel.
        rows: a DataFrame.
        numbers: of the rows, ``(rows,)``; NaN where there is none.
        reasons: why there is none; empty where there is one.
    """

    title: str
    rows: Frame
    numbers: np.ndarray
    reasons: list[str]


@matplotlib.rc_context(STYLE)
def plot_sweep(
    sweep: str | Path | pd.DataFrame,
    x: str,
    y: str,
    value: str,
    where: Mapping[str, Any] | None = None,
) -> Figure:
    """A column of a sweep over two of its inputs, with a panel for each stepper.

    A cell without a number is grey and hatched, and the legend gives the reason. Inputs of a
    random design whose values hardly ever repeat are drawn as points in place of cells.

    Arguments:
        sweep: its folder, or its rows from `ropeode.load_sweep`.
        x: an input, along the horizontal axis.
        y: another one, along the vertical axis.
        value: a column of numbers, as colour.
        where: values of inputs; only rows with these values are drawn.

    Returns:
        A matplotlib figure, 6.5 inches wide.

    Raises:
        InputError: there is no such column, or no row with these values, or several rows
            share a cell.
    """
    frame: Frame = load_sweep(sweep) if isinstance(sweep, (str, Path)) else sweep
    frame = _chosen(frame, x, y, value, dict(where or {}))
    by_stepper = "stepper" not in (x, y)
    panels = [_panel(frame, value, "")]
    if by_stepper:
        panels = [_panel(rows, value, name) for name, rows in frame.groupby("stepper")]
    across, up = _axis(frame, x), _axis(frame, y)
    size = len(across.values) * len(up.values)
    most = max(len(panel.rows) for panel in panels)
    cells = most >= _LEAST_FILLED * size
    if cells:
        _check_single(frame, [x, y, *(["stepper"] if by_stepper else [])])
    kinds = sorted({reason for panel in panels for reason in panel.reasons if reason})
    if cells and any(len(panel.rows) < size for panel in panels):
        kinds.append(NOT_COMPUTED)
    norm = _norm(np.concatenate([panel.numbers for panel in panels]))

    columns = 1 if len(panels) == 1 else 2 if len(panels) <= 4 else 3
    rows = math.ceil(len(panels) / columns)
    height = _ALONE_HEIGHT if rows == 1 else _PANEL_HEIGHT * rows
    figure = new_figure(_title(frame, value), _words(where), height + _LEGEND_HEIGHT)
    grid = new_grid(figure, rows, columns, len(panels), (_name(x), _name(y)))
    for axes, panel in zip(grid, panels, strict=True):
        draw = _draw_cells if cells else _draw_points
        draw(axes, panel, across, up, kinds, norm)
        axes.grid(False)
        axes.set_title(wrapped(panel.title, width=0.85 * WIDTH / columns), parse_math=False)
        axes.set_xscale("linear" if across.scale == "words" else across.scale)
        axes.set_yscale("linear" if up.scale == "words" else up.scale)
        _ticks(axes.xaxis, across, cells)
        _ticks(axes.yaxis, up, cells)
    if norm is not None:
        mapped = ScalarMappable(norm, matplotlib.colormaps[_COLOURS])
        figure.colorbar(mapped, ax=grid, label=_name(value), fraction=0.05)
    if kinds:
        handles = [_patch(i) if cells else _marker(i) for i in range(len(kinds))]
        figure.legend(handles, kinds, loc="outside lower center", ncols=3, title="no number")
    return figure


def _chosen(frame: Frame, x: str, y: str, value: str, where: dict[str, Any]) -> Frame:
    """The rows to be drawn, after the arguments have been checked."""
    inputs = [name for name in frame.columns if name in INPUTS or name not in COLUMNS]
    for argument, name in {"x": x, "y": y, **{f"where {name}": name for name in where}}.items():
        if name not in inputs:
            raise InputError(unknown(argument, name, inputs))
    kinds = {name: column.type for name, column in COLUMNS.items()}
    numbers = [n for n in frame.columns if kinds.get(n) in ("double", "int64") and n not in INPUTS]
    if value not in numbers:
        raise InputError(unknown("value", value, numbers))
    if x == y:
        raise bad_value("y", y, "an input other than x", "choose another")
    if frame.empty:
        allowed = "a sweep with at least one finished case"
        raise bad_value("sweep", "no finished case", allowed, "run the sweep first")
    for name, wanted in where.items():
        values = list(frame[name].dropna().unique())
        equal = [each for each in values if str(each) == str(wanted) or _equal(each, wanted)]
        if not equal:
            allowed = _listed(values) or "nothing, since no row has a value"
            fix = "choose one of these" if values else "leave it out"
            raise bad_value(f"where {name}", wanted, allowed, fix)
        frame = frame[frame[name] == equal[0]]
    return frame


def _listed(values: Sequence[Any]) -> str:
    """Values in their order, not more than there is room for."""
    more = "" if len(values) <= _MOST_LISTED else f", and {len(values) - _MOST_LISTED} more"
    return ", ".join(str(each) for each in sorted(values)[:_MOST_LISTED]) + more


def _equal(value: Any, wanted: Any) -> bool:
    """Whether two values are the same number; one may be text."""
    try:
        return float(value) == float(wanted)
    except (TypeError, ValueError):
        return False


def _check_single(frame: Frame, cell: list[str]) -> None:
    """Raises:
    InputError: several rows share a cell.
    """
    groups = frame.groupby(cell, dropna=False)
    rows = groups.size().max()
    if rows <= 1:
        return
    differing = [
        name
        for name in frame.columns
        if (name in INPUTS or name not in COLUMNS)
        and name not in (*cell, "key", "parameters")
        and groups[name].nunique(dropna=False).max() > 1
    ]
    # As few of them as leave one row in each cell; the draw decides on all drawn parameters.
    selected: list[str] = []
    for name in differing:
        if frame.groupby([*cell, *selected], dropna=False).size().max() > 1:
            selected.append(name)
    values = "; ".join(f"{name}: {_listed(frame[name].dropna().unique())}" for name in selected)
    fix = " ".join(f"--where {name}={frame[name].dropna().iloc[0]}" for name in selected)
    raise InputError(
        f"where: {rows} rows share a cell, since they differ in {', '.join(differing)}; allowed: "
        f"one row in each cell ({values}). Fix: select values, for example {fix}."
    )


def _axis(frame: Frame, name: str) -> Axis:
    values = sorted(frame[name].dropna().unique())
    scale = _scale(values)
    places = np.arange(len(values), dtype=float) if scale == "words" else np.array(values, float)
    if scale == "log":
        places = np.log(places)
    middles = (places[1:] + places[:-1]) / 2
    first, last = (middles[0], middles[-1]) if len(middles) else (places[0] - 0.5, places[0] + 0.5)
    edges = np.array([2 * places[0] - first, *middles, 2 * places[-1] - last])
    return Axis(name, values, scale, np.exp(edges) if scale == "log" else edges)


def _scale(values: Sequence[Any]) -> str:
    """The scale on which the steps between values are most nearly equal, if there is one."""
    if len(values) < 2 or not all(isinstance(v, (int, float, np.number)) for v in values):
        return "words"
    numbers = np.array(values, float)

    def unevenness(places: np.ndarray) -> float:
        steps = np.diff(places)
        return float(steps.max() / steps.min())

    linear = unevenness(numbers)
    geometric = unevenness(np.log(numbers)) if numbers[0] > 0 else np.inf
    if min(linear, geometric) > _EQUAL_WITHIN and len(values) <= _MOST_TICKS:
        return "words"
    far = numbers[0] > 0 and numbers[-1] / numbers[0] >= _EQUAL_WITHIN
    return "log" if geometric < linear or (geometric == linear and far) else "linear"


def _panel(rows: Frame, value: str, title: str) -> Panel:
    """Rows with their numbers and the reasons for those that are missing."""
    numbers = rows[value].to_numpy(float, na_value=np.nan)

    def reason(number: float, row: Any) -> str:
        if not math.isnan(number):
            return ""
        if row["status"] != "ok":
            return str(row["status"])
        if value.startswith("error_") and row["resolved"] is False:
            return "below the reference's resolution"
        if value in ("observed_order", "order_low", "order_high"):
            return f"order {row['order_verdict'] or 'not requested'}"
        return "no value"

    plain = rows[["status", "resolved", "order_verdict"]].astype(object)
    records = plain.where(plain.notna(), None).to_dict("records")
    return Panel(title, rows, numbers, list(map(reason, numbers, records)))


def _norm(numbers: np.ndarray) -> Normalize | None:
    """The scale of colours; None where there are no numbers."""
    numbers = numbers[~np.isnan(numbers)]
    if not len(numbers):
        return None
    low, high = float(min(numbers)), float(max(numbers))
    if low > 0 and high / low > _LOG_FROM:
        return LogNorm(low, high)
    return Normalize(low, high) if low < high else Normalize(low - 0.5, high + 0.5)


def _draw_cells(
    axes: Axes, panel: Panel, across: Axis, up: Axis, kinds: list[str], norm: Normalize | None
) -> None:
    numbers = np.full((len(up.values), len(across.values)), np.nan)
    reasons = np.full(numbers.shape, NOT_COMPUTED, dtype=object)
    at = up.places(panel), across.places(panel)
    numbers[at], reasons[at] = panel.numbers, panel.reasons
    if norm is not None:
        axes.pcolormesh(across.edges, up.edges, numbers, norm=norm, cmap=_COLOURS)
    for (row, column), reason in np.ndenumerate(reasons):
        if reason:
            (left, right), (low, high) = across.edges[column : column + 2], up.edges[row : row + 2]
            look = _hatched(kinds.index(reason))
            axes.add_patch(Rectangle((left, low), right - left, high - low, lw=0.0, **look))


def _draw_points(
    axes: Axes, panel: Panel, across: Axis, up: Axis, kinds: list[str], norm: Normalize | None
) -> None:
    at_x, at_y = (
        np.array(axis.places(panel) if axis.scale == "words" else panel.rows[axis.name], float)
        for axis in (across, up)
    )
    why = np.array(panel.reasons)
    some = why == ""
    if some.any():
        axes.scatter(at_x[some], at_y[some], 12, panel.numbers[some], norm=norm, cmap=_COLOURS)
    for i, kind in enumerate(kinds):
        chosen = why == kind
        marker = _MARKERS[i % len(_MARKERS)]
        axes.scatter(at_x[chosen], at_y[chosen], 16, "0.45", marker=marker, lw=0.8)


def _hatched(index: int) -> dict[str, Any]:
    hatch = _HATCHES[index % len(_HATCHES)]
    return {"facecolor": "0.88", "edgecolor": "0.45", "hatch": hatch}


def _patch(index: int) -> Patch:
    return Patch(**_hatched(index), lw=0.4)


def _marker(index: int) -> Line2D:
    return Line2D([], [], ls="", color="0.45", marker=_MARKERS[index % len(_MARKERS)])


def _ticks(axis: Any, of: Axis, cells: bool) -> None:
    if of.scale == "words":
        every = math.ceil(len(of.values) / _MOST_TICKS)
        axis.set_ticks(range(0, len(of.values), every), [_short(v) for v in of.values[::every]])
        return
    if cells and len(of.values) <= _MOST_TICKS:
        axis.set_ticks(of.values, [_short(value) for value in of.values])
        axis.set_ticks([], minor=True)


def _short(value: Any) -> str:
    return f"{value:g}" if isinstance(value, (float, np.floating)) else str(value)


def _name(column: str) -> str:
    return column.replace("_", " ")


def _title(frame: Frame, value: str) -> str:
    problems = ", ".join(sorted(set(frame["problem"])))
    return f"{_name(value).capitalize()} of a sweep: {problems}"


def _words(where: Mapping[str, Any] | None) -> str:
    return ", ".join(f"{_name(name)} {value}" for name, value in (where or {}).items())
