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
from matplotlib.colors import BoundaryNorm, Colormap, LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

from ropeode.errors import InputError
from ropeode.render.plots.labels import sweep_label
from ropeode.render.plots.style import FIGURE_WIDTH, STYLE, make_room, new_figure, new_grid, wrapped
from ropeode.sweep import COLUMNS, INPUTS, load_sweep
from ropeode.validation import bad_value, unknown

if TYPE_CHECKING:
    import pandas as pd

# A DataFrame or one of its columns; the types that pandas declares are too wide for a checker.
Frame = Any

_COLOURS = "viridis"
_PANEL_HEIGHT = 2.3
_ALONE_HEIGHT = 3.6
_MOST_TICKS = 9
# Values that span more than this are coloured by their logarithms.
_LOG_FROM = 100.0
# Steps between values count as equal if they differ by no more than this factor.
_EQUAL_WITHIN = 4.0
# If a smaller part of the cells has a row, rows are drawn as points.
_LEAST_FILLED = 0.25
# In a message.
_MOST_LISTED = 20
NOT_COMPUTED, NOT_FINITE = "not computed yet", "infinite"
_ORDERS = ("observed_order", "order_low", "order_high")
# Orders outside have the colours of the ends.
_LEAST_ORDER, _MOST_ORDER = -1, 9
# Times the motion: an error above it is that of a run that has blown up.
_HIGHEST = 10.0
# Inches that a printed number needs for each letter, and for its height.
_LETTER, _LINE = 0.065, 0.13
# A colour that is lighter than this, of 1, has black numbers on it.
_LIGHT = 0.5
# Inputs that a design combines with all others; no axis decides on them.
_CROSSED = ("steps_per_frame", "norm")
# Columns that say which row it is, rather than what was run.
_NAMES = ("key", "parameters")
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

    def middle(self, index: int) -> float:
        """The middle of a cell, as the axis shows it."""
        ends = self.edges[index : index + 2]
        return float(np.sqrt(np.prod(ends)) if self.scale == "log" else np.mean(ends))

    def places(self, panel: Panel) -> list[int]:
        """The index of each row's value."""
        index = {value: place for place, value in enumerate(self.values)}
        return [index[value] for value in panel.rows[self.name]]


class Colours(NamedTuple):
    """How numbers become colours.

    Fields:
        norm: their scale.
        map: the colours.
        beyond: at which end numbers are outside, as the colour bar's `extend` has it.
        words: what the colour bar says of that.
    """

    norm: Normalize
    map: Colormap
    beyond: str
    words: str


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
        InputError: there is no such column, or no row with these values, or rows differ in
            an input that is not shown.

    Examples:
        >>> from ropeode import plot_sweep, run_sweep
        >>> grid = {"damping": [0.0, 0.1], "num_nodes": [4], "frames": [3]}
        >>> summary = run_sweep({"steppers": ["rk4"], "grid": grid}, "ropes")
        >>> plot_sweep("ropes", "damping", "steps_per_frame", "error_max").axes[0].get_xlabel()
        'damping [mass / frame]'
    """
    frame: Frame = load_sweep(sweep) if isinstance(sweep, (str, Path)) else sweep
    if not hasattr(frame, "columns"):
        allowed = "the folder of a sweep, or a data frame of its rows"
        raise bad_value("sweep", sweep, allowed, "read them with ropeode.load_sweep(folder)")
    frame = _chosen(frame, x, y, value, dict(where or {}))
    with_axes = _check_shown(frame, x, y)
    by_stepper = "stepper" not in (x, y)
    panels = [_panel(frame, value, "")]
    if by_stepper:
        panels = [_panel(rows, value, name) for name, rows in frame.groupby("stepper")]
    size = frame[x].nunique() * frame[y].nunique()
    cells = max(len(panel.rows) for panel in panels) >= _LEAST_FILLED * size
    across, up = _axis(frame, x, cells), _axis(frame, y, cells)
    kinds = sorted({reason for panel in panels for reason in panel.reasons if reason})
    if cells and any(len(panel.rows) < size for panel in panels):
        kinds.append(NOT_COMPUTED)
    colours = _colours(frame, value, np.concatenate([panel.numbers for panel in panels]))

    columns = 1 if len(panels) == 1 else 2 if len(panels) <= 4 else 3
    rows = math.ceil(len(panels) / columns)
    height = _ALONE_HEIGHT if rows == 1 else _PANEL_HEIGHT * rows
    figure = new_figure(_title(frame, value), f"{_words(where)}{with_axes}", height)
    names = [sweep_label(name, _name(name), frame) for name in (x, y, value)]
    grid = new_grid(figure, rows, columns, len(panels), (names[0], names[1]))
    for axes, panel in zip(grid, panels, strict=True):
        draw = _draw_cells if cells else _draw_points
        draw(axes, panel, across, up, kinds, colours)
        axes.grid(False)
        axes.set_title(wrapped(panel.title, width=0.85 * FIGURE_WIDTH / columns), parse_math=False)
        axes.set_xscale("linear" if across.scale == "words" else across.scale)
        axes.set_yscale("linear" if up.scale == "words" else up.scale)
        _ticks(axes.xaxis, across, cells)
        _ticks(axes.yaxis, up, cells)
    if colours is not None:
        mapped = ScalarMappable(colours.norm, colours.map)
        label = f"{names[2]}{colours.words}"
        bar = figure.colorbar(mapped, ax=grid, label=label, fraction=0.05, extend=colours.beyond)
        if isinstance(colours.norm, BoundaryNorm):
            middles = [float(edge) + 0.5 for edge in colours.norm.boundaries[:-1]]
            bar.set_ticks(middles, labels=[f"{each:g}" for each in middles], minor=False)
    if kinds:
        handles = [_patch(i) if cells else _marker(i) for i in range(len(kinds))]
        figure.legend(handles, kinds, loc="outside lower center", ncols=3, title="no number")
        make_room(figure, height, 1 + math.ceil(len(kinds) / 3))
    if cells:
        _print_numbers(figure, grid, panels, across, up, value, colours)
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
    for argument, name in (("x", x), ("y", y)):
        if frame[name].isna().any():
            allowed = "an input that every drawn row has"
            raise bad_value(argument, name, allowed, "choose another, or select rows with --where")
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


def _check_shown(frame: Frame, x: str, y: str) -> str:
    """Words for the inputs that change along an axis and are not shown.

    Raises:
        InputError: rows differ in an input that no axis or panel shows, or are the same case.
    """
    hidden = _hidden(frame, x, y)
    if not hidden:
        if frame.duplicated([x, y, "stepper"]).any():
            allowed, fix = "each case once", "drop the rows that are there twice"
            raise bad_value("sweep", "the same case several times", allowed, fix)
        along = [name for name in _inputs(frame, x, y) if frame[name].nunique(dropna=False) > 1]
        return f"; along the axes also change: {', '.join(map(_name, along))}" if along else ""
    # As few of them as leave nothing hidden: a draw decides on all drawn parameters.
    selected: list[str] = []
    rest = frame
    while left := _hidden(rest, x, y):
        selected.append(left[0])
        rest = rest[rest[left[0]] == rest[left[0]].dropna().iloc[0]]
    values = "; ".join(f"{name}: {_listed(frame[name].dropna().unique())}" for name in selected)
    fix = " ".join(f"--where {name}={rest[name].iloc[0]}" for name in selected)
    raise InputError(
        f"where: rows differ in {', '.join(hidden)}, which this map does not show; allowed: one "
        f"value of each ({values}). Fix: select values, for example {fix}, or make them x or y."
    )


def _inputs(frame: Frame, x: str, y: str) -> list[str]:
    """The inputs but for the axes and the panels."""
    shown = (x, y, "stepper", *_NAMES)
    return [n for n in frame.columns if (n in INPUTS or n not in COLUMNS) and n not in shown]


def _hidden(frame: Frame, x: str, y: str) -> list[str]:
    """The inputs in which rows differ though neither axis decides on them."""

    def decided(name: str) -> bool:
        if name in _CROSSED:
            return frame[name].nunique(dropna=False) <= 1
        by = (frame.groupby(axis, dropna=False)[name].nunique(dropna=False) for axis in (x, y))
        return any(each.max() <= 1 for each in by)

    return [name for name in _inputs(frame, x, y) if not decided(name)]


def _axis(frame: Frame, name: str, cells: bool) -> Axis:
    values = sorted(frame[name].unique())
    scale = _scale(values, cells)
    places = np.arange(len(values), dtype=float) if scale == "words" else np.array(values, float)
    if scale == "log":
        places = np.log(places)
    middles = (places[1:] + places[:-1]) / 2
    first, last = (middles[0], middles[-1]) if len(middles) else (places[0] - 0.5, places[0] + 0.5)
    edges = np.array([2 * places[0] - first, *middles, 2 * places[-1] - last])
    return Axis(name, values, scale, np.exp(edges) if scale == "log" else edges)


def _scale(values: Sequence[Any], cells: bool) -> str:
    """The scale on which values are spread most evenly, if there is one."""
    if len(values) < 2 or not all(isinstance(v, (int, float, np.number)) for v in values):
        return "words"
    numbers = np.array(values, float)

    def unevenness(places: np.ndarray) -> float:
        steps = np.diff(places)
        return float(steps.max() / steps.min())

    linear = unevenness(numbers)
    geometric = unevenness(np.log(numbers)) if numbers[0] > 0 else np.inf
    if min(linear, geometric) > _EQUAL_WITHIN:
        if cells and len(values) <= _MOST_TICKS:
            return "words"
        # Draws: whichever of the two distributions makes them more likely.
        if numbers[0] <= 0:
            return "linear"
        logs = np.log(numbers)
        uniform = -len(logs) * np.log(np.ptp(numbers))
        return "log" if -np.sum(logs) - len(logs) * np.log(np.ptp(logs)) > uniform else "linear"
    far = numbers[0] > 0 and numbers[-1] / numbers[0] >= _EQUAL_WITHIN
    return "log" if geometric < linear or (geometric == linear and far) else "linear"


def _panel(rows: Frame, value: str, title: str) -> Panel:
    """Rows with their numbers and the reasons for those that are missing."""
    numbers = rows[value].to_numpy(float, na_value=np.nan)

    def reason(number: float, row: Any) -> str:
        if math.isfinite(number):
            return ""
        if math.isinf(number):
            return NOT_FINITE
        if row["status"] != "ok":
            return str(row["status"])
        if value.startswith("error_") and row["resolved"] is False:
            return "below the reference's resolution"
        if value in ("observed_order", "order_low", "order_high"):
            return f"order {row['order_verdict'] or 'not requested'}"
        return "no value"

    plain = rows[["status", "resolved", "order_verdict"]].astype(object)
    records = plain.where(plain.notna(), None).to_dict("records")
    reasons = list(map(reason, numbers, records))
    return Panel(title, rows, np.where(np.isfinite(numbers), numbers, np.nan), reasons)


def _colours(frame: Frame, value: str, numbers: np.ndarray) -> Colours | None:
    """The scale of colours; None where there are no numbers."""
    numbers = numbers[~np.isnan(numbers)]
    if not len(numbers):
        return None
    low, high = float(min(numbers)), float(max(numbers))
    colours = matplotlib.colormaps[_COLOURS]
    whole = np.floor(np.array([low, high]) + 0.5)
    if value in _ORDERS:
        first, last = np.clip(whole, _LEAST_ORDER, _MOST_ORDER)
        return _discrete(first, last, low, high, ", by the nearest whole number")
    if _integral(value) and np.ptp(whole) <= _MOST_ORDER - _LEAST_ORDER:
        return _discrete(whole[0], whole[1], low, high, "")
    words, most = "", high
    if value.startswith("error_"):
        most = _HIGHEST * float(frame["motion_size"].max(skipna=True) or np.nan)
        if high > most:
            high, words = most, f"\nlargest colour: above {most:.1e}, 10 × the motion"
            # Where all have blown up, one colour says so.
            low = min(low, most / _LOG_FROM)
    beyond = _beyond((low, high), low, float(max(numbers)))
    if low > 0 and high / low > _LOG_FROM:
        return Colours(LogNorm(low, high), colours, beyond, words)
    margin = 0.0 if low < high else 0.5
    return Colours(Normalize(low - margin, high + margin), colours, beyond, words)


def _discrete(first: float, last: float, low: float, high: float, words: str) -> Colours:
    """A colour for each whole number; a single one is shown between its neighbours."""
    margin = 0.5 if first < last else 1.5
    edges = np.arange(first - margin, last + margin + 0.5)
    colours = matplotlib.colormaps[_COLOURS]
    return Colours(BoundaryNorm(edges, colours.N), colours, _beyond(edges, low, high), words)


def _integral(column: str) -> bool:
    return column in COLUMNS and COLUMNS[column].type == "int64"


def _beyond(ends: Sequence[float] | np.ndarray, low: float, high: float) -> str:
    below, above = low < ends[0], high > ends[-1]
    return "both" if below and above else "min" if below else "max" if above else "neither"


def _draw_cells(
    axes: Axes, panel: Panel, across: Axis, up: Axis, kinds: list[str], colours: Colours | None
) -> None:
    numbers = np.full((len(up.values), len(across.values)), np.nan)
    reasons = np.full(numbers.shape, NOT_COMPUTED, dtype=object)
    at = up.places(panel), across.places(panel)
    numbers[at], reasons[at] = panel.numbers, panel.reasons
    if colours is not None:
        axes.pcolormesh(across.edges, up.edges, numbers, norm=colours.norm, cmap=colours.map)
    for (row, column), reason in np.ndenumerate(reasons):
        if reason:
            (left, right), (low, high) = across.edges[column : column + 2], up.edges[row : row + 2]
            look = _hatched(kinds.index(reason))
            axes.add_patch(Rectangle((left, low), right - left, high - low, lw=0.0, **look))


def _draw_points(
    axes: Axes, panel: Panel, across: Axis, up: Axis, kinds: list[str], colours: Colours | None
) -> None:
    at_x, at_y = (
        np.array(axis.places(panel) if axis.scale == "words" else panel.rows[axis.name], float)
        for axis in (across, up)
    )
    why = np.array(panel.reasons)
    some = why == ""
    if colours is not None and some.any():
        look = {"norm": colours.norm, "cmap": colours.map, "edgecolors": "0.3", "linewidths": 0.3}
        axes.scatter(at_x[some], at_y[some], 14, panel.numbers[some], **look)
    for i, kind in enumerate(kinds):
        chosen = why == kind
        marker = _MARKERS[i % len(_MARKERS)]
        axes.scatter(at_x[chosen], at_y[chosen], 16, "0.45", marker=marker, lw=0.8)


def _print_numbers(
    figure: Figure, grid: Sequence[Axes], panels: Sequence[Panel], across: Axis, up: Axis,
    value: str, colours: Colours | None,
) -> None:  # fmt: skip
    """The number in each cell, where all cells have room for it."""
    form = "{:.0f}" if _integral(value) else "{:.2f}" if value in _ORDERS else "{:.1e}"
    printed = [[form.format(number) for number in panel.numbers] for panel in panels]
    figure.draw_without_rendering()
    box = grid[0].get_window_extent()
    room = np.array([box.width, box.height]) / figure.dpi
    room /= len(across.values), len(up.values)
    longest = max(len(text) for texts in printed for text in texts)
    if colours is None or np.any(room < (_LETTER * longest, _LINE)):
        return
    for axes, panel, texts in zip(grid, panels, printed, strict=True):
        places = zip(across.places(panel), up.places(panel), panel.numbers, texts, strict=True)
        for column, row, number, text in places:
            if not math.isnan(number):
                middle = across.middle(column), up.middle(row)
                shade = np.dot(colours.map(colours.norm(number))[:3], (0.299, 0.587, 0.114))
                colour = "black" if shade > _LIGHT else "white"
                look = {"ha": "center", "va": "center", "fontsize": 6.5, "color": colour}
                axes.text(middle[0], middle[1], text, **look)


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
