"""Pictures of the rope report: one for each figure, and contact sheets."""

from __future__ import annotations

import math

import matplotlib
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from ropeode.case_studies.figures import ENDS
from ropeode.case_studies.results import (
    FigureResult,
    Reading,
    Report,
    measured_words,
    theory_words,
)
from ropeode.problems.rope import Rope
from ropeode.progress import Progress
from ropeode.render import (
    COLOURS,
    FIGURE_WIDTH,
    STYLE,
    figure_bytes,
    make_room,
    new_figure,
    wrapped,
)
from ropeode.render.plots.overlaps import take_turns

# How often the rope is drawn while it falls and swings for the first time.
_SHAPES = 16
_FIRST_SWING = 120
_HEIGHT = 3.9
_PER_SHEET = 12
_SHEET_COLUMNS = 4
_SHEET_HEIGHT = 5.4
# In lengths of the rope: how far a picture reaches from the pin, to the sides and down, and up.
_VIEW, _VIEW_UP = 1.15, 0.65
_TRACE, _END = COLOURS[1], COLOURS[6]
# Of the rope over time. The end of the scale is too pale for lines on white.
_SHADES = matplotlib.colormaps["viridis"](np.linspace(0.0, 0.9, 64))
_SMALL = 7.5


@matplotlib.rc_context(STYLE)
def plot_report_figure(result: FigureResult) -> Figure:
    """A figure of the report: the rope over time with its free end's trace, and its speed.

    The rope that is drawn to the left is shown; of a run that flew apart, what came before.

    Arguments:
        result: one of `Report.figures`.
    """
    claim = f"“{result.figure.words}”: {result.verdict}"
    figure = new_figure(_title(result), claim, _HEIGHT)
    if not result.readings:
        axes = figure.subplots()
        _draw_still(axes, result)
        _label_plane(axes)
        return _with_legend(figure, result)
    shapes, speeds = figure.subplots(1, 2, width_ratios=(1.0, 1.25))
    scale = _draw_shapes(shapes, result.readings[0])
    _label_plane(shapes)
    mappable = ScalarMappable(scale, LinearSegmentedColormap.from_list("cut", _SHADES))
    look = {"orientation": "horizontal", "fraction": 0.05, "aspect": 30, "pad": 0.02}
    figure.colorbar(mappable, ax=shapes, label="frame of each rope", **look)
    _draw_speed(speeds, result)
    return _with_legend(figure, result)


@matplotlib.rc_context(STYLE)
def plot_contact_sheets(report: Report) -> list[Figure]:
    """All figures in small, twelve on a sheet.

    Arguments:
        report: from `ropeode.rope_report`.
    """
    sheets = []
    key: list[Artist] = [
        Line2D([], [], color=_SHADES[0], label="at the start"),
        Line2D([], [], color=_SHADES[-1], label=f"frame {_FIRST_SWING}, or when it flew apart"),
        Line2D([], [], color=_END, marker=".", label="at the end"),
        Line2D([], [], color=_TRACE, alpha=0.7, label="trace of the free end"),
    ]
    for first in range(0, len(report.figures), _PER_SHEET):
        shown = report.figures[first : first + _PER_SHEET]
        rows = -(-len(shown) // _SHEET_COLUMNS)
        title = f"Figures {shown[0].figure.figure} to {shown[-1].figure.figure}"
        height = 0.7 + (_SHEET_HEIGHT - 0.7) * rows / (_PER_SHEET // _SHEET_COLUMNS)
        sheet = new_figure(title, "", height)
        sheet.legend(handles=key, loc="outside lower center", ncols=len(key), fontsize=_SMALL)
        grid = sheet.subplots(rows, _SHEET_COLUMNS, squeeze=False).ravel()
        for axes, result in zip(grid, shown, strict=False):
            if result.readings:
                _draw_shapes(axes, result.readings[0])
            else:
                _draw_still(axes, result, markersize=1.5)
            axes.set_title(_title(result, small=True), fontsize=6.5, loc="left")
            axes.set(xticks=[], yticks=[], xlabel="", ylabel="")
        for axes in grid[len(shown) :]:
            axes.remove()
        sheets.append(sheet)
    return sheets


def _title(result: FigureResult, *, small: bool = False) -> str:
    """The setting; small, as on a sheet, in short lines with the verdict."""
    figure = result.figure
    what, how = f"{figure.num_nodes} nodes", "not moving"
    if figure.run_as is not None:
        steps = f"{figure.steps_per_frame}{'' if small else ' steps'}/frame"
        what, how = figure.run_as.split(":")[0], f"{steps}, damping {figure.damping:g}"
    if small:
        return f"{figure.figure}: {what}\n{how}\n{result.verdict}"
    return f"Figure {figure.figure}: {what}, {how}"


def _with_legend(figure: Figure, result: FigureResult) -> Figure:
    """A figure with one legend below it, of what all axes label, under what was found."""
    handles = {
        label: handle
        for axes in figure.axes
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    theory = theory_words(result)
    found = [f"Measured: {measured_words(result)}.", f"Theory: {theory}." if theory else ""]
    legend = figure.legend(
        list(handles.values()),
        list(handles),
        loc="outside lower left",
        ncols=3,
        fontsize=_SMALL,
        title=wrapped(*found, width=1.4 * FIGURE_WIDTH),
        title_fontsize=_SMALL,
        alignment="left",
    )
    for handle in legend.get_lines():
        handle.set_linewidth(1.2)
    lines = legend.get_title().get_text().count("\n") + 1
    make_room(figure, _HEIGHT, lines + math.ceil(len(handles) / 3))
    return figure


def _draw_still(axes: Axes, result: FigureResult, markersize: float = 5.0) -> None:
    """The rope before it moves, in both images."""
    for end, colour in zip(ENDS, COLOURS, strict=False):
        problem = Rope(end=end, num_nodes=result.figure.num_nodes).problem(1)
        x, y = problem.positions(problem.y0[None])[0].T
        label = f"from (0, 200) to ({end[0]:g}, 200)"
        axes.plot(x, y, "o-", color=colour, markersize=markersize, label=label)
    axes.set(xlim=(-460, 460), ylim=(-260, 460), aspect="equal")


def _draw_shapes(axes: Axes, reading: Reading) -> Normalize:
    """The rope at some frames, and the trace of its free end.

    Returns:
        The scale from frames to the colours of the rope.
    """
    places = reading.trajectory.positions[: reading.motion.frames + 1]
    last = min(_FIRST_SWING, len(places) - 1)
    frames = np.unique(np.linspace(0, last, _SHAPES).round().astype(int))
    scale = Normalize(0, max(last, 1))
    trace = places[:, -1]
    axes.plot(*trace.T, color=_TRACE, lw=0.4, alpha=0.7, label="trace of the free end")
    for frame in frames:
        colour = _SHADES[round(scale(frame) * (len(_SHADES) - 1))]
        axes.plot(*places[frame].T, color=colour, lw=0.8)
    axes.plot(*places[-1].T, ".-", color=_END, ms=2.5, label=f"rope at frame {len(places) - 1}")
    args = reading.trajectory.problem.args
    length = float(np.sum(args.rest_length))
    pin = places[0, 0]
    axes.set_xlim(pin[0] - _VIEW * length, pin[0] + _VIEW * length)
    axes.set_ylim(pin[1] - _VIEW * length, pin[1] + _VIEW_UP * length)
    axes.set_aspect("equal")
    return scale


def _label_plane(axes: Axes) -> None:
    axes.set(xlabel="x [length units]", ylabel="y [length units]", aspect="equal")


def _draw_speed(axes: Axes, result: FigureResult) -> None:
    """The fastest node's speed over time for each meaning, and what the verdicts rest on."""
    axes.xaxis.set_major_locator(MaxNLocator(5))
    axes.set(yscale="log", xlabel="time [frames]", ylabel="fastest node [length units/frame]")
    lines = []
    for reading, colour in zip(result.readings, COLOURS, strict=False):
        motion, problem = reading.motion, reading.trajectory.problem
        velocities = reading.trajectory.velocities[: motion.frames + 1]
        speed = np.max(np.linalg.norm(velocities, axis=2), axis=1)
        frames, speeds = _thinned(np.where(speed > 0, speed, np.nan))
        which = ""
        if len(result.readings) > 1:
            which = "as worded" if reading.meaning == "words" else "as listed"
        lines += axes.plot(frames, speeds, color=colour, lw=0.7, label=which or "fastest node")
        marks = (("at rest from", motion.settled_at, "--"), ("apart at", motion.diverged_at, ":"))
        for words, frame, style in marks:
            if frame is not None:
                label = f"{which + ': ' if which else ''}{words} frame {frame}"
                axes.axvline(
                    frame, color=colour if style == "--" else _TRACE, ls=style, label=label
                )
    gravity = np.linalg.norm(problem.args.gravity[:, 0])
    rest = motion.thresholds.speed * np.sqrt(gravity * np.sum(problem.args.rest_length))
    axes.axhline(rest, color="0.4", lw=0.8, ls="-.", label="slower is at rest")
    low, high = axes.get_ylim()
    axes.set_ylim(max(low, rest * 1e-4), min(high, rest * 1e6))
    take_turns(lines)


def _thinned(speed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Frames and speeds, no more than can be seen: the extremes of blocks of them."""
    block = max(1, len(speed) // 2000)
    if block == 1:
        return np.arange(len(speed)), speed
    whole = speed[: len(speed) // block * block].reshape(-1, block)
    frames = np.arange(len(whole)) * block
    return np.repeat(frames, 2), np.stack([whole.min(axis=1), whole.max(axis=1)], axis=1).ravel()


def draw_report(report: Report, progress: Progress) -> dict[str, bytes]:
    """All pictures of a report, as the contents of PNG files by their names.

    Arguments:
        report: from `ropeode.rope_report`.
        progress: called with what is being drawn and the fraction that is done.
    """
    files = {}
    for index, each in enumerate(report.figures):
        progress(f"picture {each.figure.figure}", index / len(report.figures))
        name = f"figure-{each.figure.figure:02}.png"
        files[name] = figure_bytes(plot_report_figure(each), ".png")
    progress("contact sheets", 1.0)
    for number, sheet in enumerate(plot_contact_sheets(report), start=1):
        files[f"contact-sheet-{number}.png"] = figure_bytes(sheet, ".png")
    return files
