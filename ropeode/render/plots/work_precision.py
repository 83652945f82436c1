"""Error against cost: a work-precision study as a picture, with efforts where they hide nothing."""

from __future__ import annotations

import html
import itertools
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import matplotlib
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import NullFormatter
from matplotlib.transforms import Bbox

from ropeode.render import table_words
from ropeode.render.plots.labels import with_unit
from ropeode.render.plots.point_markers import MARKS as OF_ORDERS
from ropeode.render.plots.point_markers import UNRESOLVED
from ropeode.render.plots.point_markers import in_legend as of_orders_in_legend
from ropeode.render.plots.style import (
    BAND,
    BAND_EDGE,
    COLOURS,
    MARKERS,
    STYLE,
    draw_legends,
    figure_bytes,
    new_figure,
)
from ropeode.render.work_precision import effort_cell, effort_words, error_words_of
from ropeode.study import INFINITE, Cost, Measure, WorkPrecision, WorkRow, check_axes
from ropeode.validation import check_kind

_AXES_HEIGHT = 4.2
_COST_LABELS: dict[Cost, str] = {
    "seconds": "time [s]",
    "rhs_evaluations": "evaluations of the right-hand side",
    "steps": "steps",
}
_MEASURE_WORDS: dict[Measure, str] = {
    "error_final": "final error",
    "error_max": "max error",
    "error_rms": "rms error",
    "energy_error": "max energy error",
}
# Methods of a family differ in their lines, and all methods in their markers.
_LINES: Any = ("-", (0, (4, 1.5)), (0, (1, 1.2)), (0, (5, 1.2, 1, 1.2)))
# Okabe and Ito's yellow: too pale for a line, and in grey lighter than the band.
_FRONT: Any = {
    "color": "#F0E442",
    "linewidth": 6.0,
    "alpha": 0.7,
    "solid_capstyle": "round",
    # A front of one run is a point.
    "marker": "o",
    "markersize": 11.0,
    "markeredgewidth": 0.0,
    "zorder": 0.8,
}
_LABEL_SIZE = 6.5
# Of the texts that no label may cover, along each piece of a line.
_DENSE = 80
# In points of 1/72 inch: a letter's width and height over the font's size, the way to the text, and
# half of a mark.
_WIDE, _HIGH, _AWAY, _MARK = 0.6, 1.0, 5.0, 2.0
# Where a text may stand: right, left, above, below, and the corners between.
_SIDES = ((1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, 1), (1, -1), (-1, -1))
_ALIGN = {-1: "right", 0: "center", 1: "left"}
_UPRIGHT = {-1: "top", 0: "center", 1: "bottom"}

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


class Look(NamedTuple):
    """How a method is drawn.

    Fields:
        colour: that of its family.
        marker: its own.
        line: differs from those of its family.
    """

    colour: str
    marker: str
    line: Any


def looks(study: WorkPrecision) -> dict[str, Look]:
    """How each method is drawn."""
    families: dict[str, list[str]] = {}
    for method, family in study.methods.items():
        families.setdefault(family, []).append(method)
    numbers = {family: index for index, family in enumerate(families)}
    return {
        method: Look(
            COLOURS[numbers[family] % len(COLOURS)],
            MARKERS[index % len(MARKERS)],
            _LINES[families[family].index(method) % len(_LINES)],
        )
        for index, (method, family) in enumerate(study.methods.items())
    }


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


@matplotlib.rc_context(STYLE)
def plot_work_precision(
    study: WorkPrecision, cost: Cost = "seconds", measure: Measure = "error_max"
) -> Figure:
    """Error against cost, with the Pareto front and the runs that have no error.

    Arguments:
        study: from `ropeode.work_precision`.
        cost: `seconds`, `rhs_evaluations` or `steps`.
        measure: `error_final`, `error_max`, `error_rms` or `energy_error`.

    Returns:
        A matplotlib figure, 6.5 inches wide, with one pair of logarithmic axes. Families have
        colours, methods markers; docs/howto/work-precision.md says what each mark means.

    Raises:
        InputError: there is no such cost or measure, or the problem has no energy.

    Examples:
        >>> from ropeode import Rope, plot_work_precision, work_precision
        >>> rope = Rope(num_nodes=4).problem(frames=3)
        >>> study = work_precision(rope, ["rk4"], steps_per_frame=[16, 64], rounds=1)
        >>> plot_work_precision(study, "steps").axes[0].get_xlabel()
        'steps'
    """
    return _figure(study, cost, measure)[0]


def _figure(
    study: WorkPrecision, cost: Cost, measure: Measure
) -> tuple[Figure, list[tuple[str, WorkPoint]]]:
    """The figure, and its points with the ids that they have in SVG."""
    check_kind("study", study, WorkPrecision, "work_precision")
    resolution = check_axes(study, cost, measure)
    title = f"Error against cost: {table_words.problem_words(study.problem)}"
    words = table_words.error_words(study).rstrip(".")
    if measure == "energy_error":
        words = "Error: largest difference from the true energy at the samples"
    figure = new_figure(title, words, _AXES_HEIGHT)
    axes = figure.subplots()
    drawn, wide, high = points_and_limits(study, cost, measure, resolution)
    quantity = "energy" if measure == "energy_error" else study.norm.quantity
    axes.set(
        xscale="log",
        yscale="log",
        xlim=wide,
        ylim=high,
        xlabel=_COST_LABELS[cost],
        ylabel=with_unit(_MEASURE_WORDS[measure], study.problem, quantity),
    )
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.axhspan(high[0] / 10.0, resolution, color=BAND, linewidth=0, zorder=0.5)
    axes.axhline(resolution, color=BAND_EDGE, linewidth=0.8, zorder=0.6)
    front = front_line(study, cost, measure)
    axes.plot(*front, label="front", gid="front", **_FRONT)
    named, lines = _draw_points(axes, study, drawn, cost)
    # The axes get their place, which the labels depend on.
    _draw_legends(figure, study, drawn, resolution)
    figure.draw_without_rendering()
    labels = [each for method in study.methods for each in _efforts(study, drawn, method)]
    # None, where no run has this cost.
    marks = np.reshape([(point.cost, point.error) for point in drawn], (-1, 2))
    place_labels(axes, labels, np.concatenate([*lines, marks]), _LABEL_SIZE)
    return figure, named


def points_and_limits(
    study: WorkPrecision, cost: Cost, measure: Measure, resolution: float
) -> tuple[list[WorkPoint], Ends, Ends]:
    """The runs that have a cost, each with its mark and inside the axes; their ends."""
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


def _draw_points(
    axes: Axes, study: WorkPrecision, drawn: Sequence[WorkPoint], cost: Cost
) -> tuple[list[tuple[str, WorkPoint]], list[np.ndarray]]:
    """Draw lines and marks.

    Returns:
        The points with their ids, and points along the lines.
    """
    named, along = [], [np.empty((0, 2))]
    for method, look in looks(study).items():
        own = [point for point in drawn if point.row.method == method]
        for piece in _neighbours(study, own):
            axes.plot(*piece.T, color=look.colour, linestyle=look.line, zorder=2)
            along.append(_dense(piece))
        for point in own:
            # No name of a method: it may hold what HTML reads as its own.
            row, name = point.row, f"{cost}-run-{len(named)}"
            form = {"marker": look.marker, **MARKS.get(point.mark, {})}
            if cost == "seconds" and point.mark == CERTIFIED:
                ends = np.array([(end, point.error) for end in (row.seconds_min, row.seconds_max)])
                axes.plot(*ends.T, color=look.colour, linewidth=0.7, alpha=0.5)
                along.append(_dense(ends))
            axes.plot(
                [point.cost],
                [point.error],
                color=look.colour,
                linestyle="none",
                zorder=3,
                gid=name,
                **form,
            )
            named.append((name, point))
    return named, along


def _neighbours(study: WorkPrecision, own: Sequence[WorkPoint]) -> list[np.ndarray]:
    """The certified runs of a method, in pieces that no other run of it interrupts.

    Between them a cost may be interpolated, and so a line be drawn.
    """
    at = {id(row): index for index, row in enumerate(study.rows)}
    certified = [point for point in own if point.mark == CERTIFIED]
    pieces: list[list[WorkPoint]] = []
    for before, point in zip([None, *certified], certified, strict=False):
        if before is None or at[id(point.row)] != at[id(before.row)] + 1:
            pieces.append([])
        pieces[-1].append(point)
    return [np.array([(point.cost, point.error) for point in piece]) for piece in pieces]


def _dense(line: np.ndarray) -> np.ndarray:
    """Points ``(points, 2)`` all along a line, which is straight in logarithms."""
    logs = np.log(line)
    parts = np.linspace(0.0, 1.0, _DENSE)[:, None]
    pieces = [a + parts * (b - a) for a, b in itertools.pairwise(logs)]
    return np.exp(np.concatenate([logs[:1], *pieces]))


def _efforts(
    study: WorkPrecision, drawn: Sequence[WorkPoint], method: str
) -> list[tuple[float, float, str, str]]:
    """The efforts of a method's first and last certified runs, as labels."""
    certified = [p for p in drawn if p.row.method == method and p.mark == CERTIFIED]
    colour = looks(study)[method].colour
    ends = certified[:1] + certified[-1:] * (len(certified) > 1)
    return [(p.cost, p.error, effort_cell(p.row), colour) for p in ends]


def place_labels(
    axes: Axes,
    labels: Sequence[tuple[float, float, str, str]],
    taken: np.ndarray,
    size: float,
) -> None:
    """Write texts beside points; those that would hide something are left out.

    Arguments:
        axes: with their limits set.
        labels: where each point is, its text, and its colour; the first come first.
        taken: points of lines and marks that no text may cover, ``(points, 2)``, in the data's
            coordinates.
        size: of the font, in points.
    """
    figure = axes.get_figure(root=True)
    assert figure is not None
    scale = 72.0 / figure.dpi
    at = axes.transData.transform(np.asarray(taken, float)) * scale
    frame = Bbox(axes.bbox.get_points() * scale)
    boxes: list[Bbox] = []
    for x, y, text, colour in labels:
        here = axes.transData.transform((x, y)) * scale
        width, height = _WIDE * size * len(text), _HIGH * size
        for across, up in _SIDES:
            low = here + np.array([across, up]) * _AWAY
            low -= np.array([(1 - across) * width, (1 - up) * height]) / 2
            box = Bbox.from_bounds(low[0], low[1], width, height)
            inside = np.all(frame.min <= box.min) and np.all(box.max <= frame.max)
            hides = box.padded(_MARK).count_contains(at) or box.count_overlaps(boxes)
            if inside and not hides:
                boxes.append(box)
                axes.annotate(
                    text,
                    (x, y),
                    (across * _AWAY, up * _AWAY),
                    textcoords="offset points",
                    ha=_ALIGN[across],
                    va=_UPRIGHT[up],
                    fontsize=size,
                    color=colour,
                    annotation_clip=False,
                )
                break


def _draw_legends(
    figure: Figure, study: WorkPrecision, drawn: Sequence[WorkPoint], resolution: float
) -> None:
    shown = {point.row.method for point in drawn}
    methods = [
        Line2D(
            [],
            [],
            color=look.colour,
            marker=look.marker,
            linestyle=look.line,
            label=f"{method} ({study.methods[method]})" + ": no run here" * (method not in shown),
        )
        for method, look in looks(study).items()
    ]
    grey = {"color": "0.3", "linestyle": "none"}
    meanings: list[Artist] = [
        Line2D([], [], label="Pareto front: no run is better for less", **_FRONT)
    ]
    for mark, form in MARKS.items():
        if any(point.mark == mark for point in drawn):
            shown = of_orders_in_legend(UNRESOLVED) if mark == BELOW else {**form, "clip_on": True}
            meanings.append(Line2D([], [], label=mark, **{**grey, **shown}))
    words = f"below {resolution:.1e}, 10 × the reference's bound"
    meanings.append(Patch(facecolor=BAND, edgecolor=BAND_EDGE, label=words))
    efforts = "numbers: steps per frame, or the tolerance"
    meanings.append(Line2D([], [], linestyle="none", label=efforts))
    draw_legends(figure, _AXES_HEIGHT, methods, meanings)


@matplotlib.rc_context(STYLE)
def picture_with_hover(
    study: WorkPrecision, cost: Cost = "seconds", measure: Measure = "error_max"
) -> str:
    """The picture as SVG, whose points say their values where the pointer rests.

    Arguments are those of `plot_work_precision`.
    """
    figure, named = _figure(study, cost, measure)
    svg = figure_bytes(figure, ".svg").decode()
    for name, point in named:
        group = f'<g id="{name}">'
        assert group in svg
        title = f"<title>{html.escape(hover_words(study, point))}</title>"
        svg = svg.replace(group, f'<g id="{name}" class="run" tabindex="0">{title}', 1)
    return svg.replace("<defs>", f"<style>{_HOVER}</style><defs>", 1)


_HOVER = ".run:hover, .run:focus { stroke: #000; stroke-width: 3; outline: none }"


def hover_words(study: WorkPrecision, point: WorkPoint) -> str:
    """What a point says, a value in each line."""
    row = point.row
    lines = [
        f"{row.method}, {effort_words(row)}",
        f"max error: {error_words_of(study, row)}",
    ]
    if row.status == "ok":
        lines += [
            f"final error: {table_words.error_cell(row.error_final, study.resolution)}",
            f"rms error: {table_words.error_cell(row.error_rms, study.resolution)}",
        ]
        if study.energy_resolution is not None:
            energy = table_words.error_cell(row.energy_error, study.energy_resolution)
            lines.append(
                f"energy error: {energy if row.energy_error != INFINITE else 'not finite'}"
            )
        if row.error_over_tolerance is not None:
            lines.append(f"error / tolerance: {row.error_over_tolerance:.3g}")
    if row.seconds is not None:
        lines.append(f"seconds: {row.seconds:.3g} ({row.seconds_min:.3g} to {row.seconds_max:.3g})")
    if row.rhs_evaluations is not None:
        lines.append(f"evaluations: {row.rhs_evaluations}")
    if row.steps is not None:
        lines.append(f"steps: {row.steps}")
    if row.why is not None:
        lines.append(row.why)
    return "\n".join(lines)
