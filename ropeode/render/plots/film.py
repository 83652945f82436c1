"""The pictures of a film: the nodes of a reference and of runs, side by side.

A run near the reference is drawn with its error magnified. The view of a run that leaves it grows.
The words at the panel say by how much.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from ropeode.render.plots.labels import unit_of
from ropeode.render.plots.style import STYLE, new_grid, stepper_style, wrapped
from ropeode.render.table_words import problem_words
from ropeode.study import NodePath, NodePaths
from ropeode.validation import counted

DPI = 120
_PANEL_WIDTH, _LEAST_WIDTH, _MOST_COLUMNS = 2.6, 5.2, 3
_LINE_HEIGHT, _AROUND_PANEL, _GAP = 0.19, 0.65, 0.15
_SMALL, _FOOT_LETTERS = 7.0, 1.25
# Height over width of a panel, at least and at most.
_FLATTEST, _STEEPEST = 0.5, 1.4
_MARGIN = 0.08
# Errors are magnified up to this part of the size of the reference's room, and the view holds runs
# that never leave that by more than the other.
_LARGEST_ERROR, _FURTHEST = 0.2, 0.5
# The reference's bound, magnified, is no more than this part.
_UNSEEN = 0.002
# States beyond cannot be scaled without overflow.
_LARGEST = 1e290
_LONGEST_BAR = 0.3
# Shades that a GIF has.
_DARK, _BEHIND, _FRAME = "0.2", "0.7333", "0.7333"
_FOOT = (
    "Grey: the reference. Thin line: the path of one node. Errors × 100: each node is drawn 100 "
    "times as far from the reference as it is. View × 100: it is 100 times as wide as in the other "
    "panels, whose view is the dashed box."
)

ShowSample = Callable[[int], None]


@matplotlib.rc_context(STYLE)
def film(paths: NodePaths) -> tuple[Figure, ShowSample]:
    """A figure, and a function that makes it show the sample with an index.

    What changes between samples is `animated`: a canvas leaves it out when it draws the figure.

    Arguments:
        paths: to be drawn.
    """
    runs = [_Run(paths, path) for path in paths.paths]
    middle, half = _view(_trusted(paths), runs)
    count = 1 + len(runs)
    columns = 2 if count == 4 else min(count, _MOST_COLUMNS)
    rows = math.ceil(count / columns)
    width = max(_LEAST_WIDTH, columns * _PANEL_WIDTH)
    panel_width = width / columns - _GAP
    foot = wrapped(_FOOT, width=_FOOT_LETTERS * width)
    lines = len([*_head(paths, width).splitlines(), *foot.splitlines()])
    panel_height = panel_width * half[1] / half[0]
    # Beyond the first, of the longest name.
    names = [wrapped(run.path.stepper, width=panel_width) for run in runs]
    more = max((name.count("\n") for name in names), default=0)
    around = _AROUND_PANEL + _LINE_HEIGHT * more
    height = _LINE_HEIGHT * lines + rows * (around + panel_height)
    layout = ConstrainedLayoutEngine(w_pad=_GAP / 2, h_pad=0.03)
    figure = Figure(figsize=(width, height), dpi=DPI, layout=layout)
    head = figure.suptitle(_head(paths, width), x=0.02, ha="left", parse_math=False)
    figure.supxlabel(foot, x=0.02, ha="left", fontsize=_SMALL, color="0.35")

    draw = functools.partial(_Panel, paths, middle, half)
    known, *others = new_grid(figure, rows, columns, count, ("", ""))
    now = known.text(0, 0, "", fontsize=head.get_fontsize(), animated=True, va="top")
    now.set_in_layout(False)
    shows = [draw(known, None, _DARK, panel_width)]
    for index, (axes, run) in enumerate(zip(others, runs, strict=True)):
        shows.append(draw(axes, run, stepper_style(index)[0], panel_width))

    def show(sample: int) -> None:
        now.set_text(_time_words(paths, sample))
        for each in shows:
            each.show(sample)

    # Laid out once, so that nothing moves but the nodes.
    show(0)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    # Into the last line of the title, which is empty.
    corner = head.get_window_extent()
    now.set(transform=None, position=(corner.x0, corner.y0 + _LINE_HEIGHT * DPI))
    return figure, show


class _Run:
    """The nodes of a run as they are drawn.

    Arguments:
        paths: that it is one of.
        path: the run.
    """

    def __init__(self, paths: NodePaths, path: NodePath):
        self.path, self.shown = path, np.clip(path.positions[..., :2], -_LARGEST, _LARGEST)
        errors = path.differences[..., :2]
        self.times_error = _magnification(paths, errors)
        if self.times_error > 1:
            self.shown[: len(errors)] += (self.times_error - 1) * errors


class _Panel:
    """The nodes of the reference or of one run, and the words around them.

    Arguments:
        paths: to be drawn.
        middle: of the view.
        half: its width and height, halved.
        axes: gets the panel.
        run: what it shows; None for the reference.
        colour: of its nodes.
        width: in inches.
    """

    def __init__(
        self,
        paths: NodePaths,
        middle: np.ndarray,
        half: np.ndarray,
        axes: Axes,
        run: _Run | None,
        colour: str,
        width: float,
    ):
        self.paths, self.run, self.middle = paths, run, middle
        self.truth, self.node = _trusted(paths), _traced(paths)
        self.shown = self.truth if run is None else run.shown
        away = np.max(np.abs(self.shown - middle) / half, axis=(1, 2))
        # It only ever grows, so that it does not flicker.
        self.zooms = [1.0 if far <= 1 else _round_up(far) for far in np.maximum.accumulate(away)]

        mechanics = paths.problem.mechanics
        in_a_row = mechanics is not None and mechanics.links is not None
        joined = "-" if in_a_row else "none"
        nodes = {"linestyle": joined, "linewidth": 1.4, "marker": "o", "markersize": 3}
        behind = {**nodes, "color": _BEHIND, "markersize": 2}
        styles = (
            behind,
            {"color": colour, "alpha": 0.45, "linewidth": 0.8},
            {**nodes, "color": colour},
        )
        self.behind, self.trace, self.nodes = (
            axes.plot([], [], animated=True, **style)[0] for style in styles
        )
        (self.box,) = axes.plot([], [], animated=True, color="0.4", linewidth=0.8, linestyle="--")
        low, high = middle - half, middle + half
        self.corners = np.array([low, (high[0], low[1]), high, (low[0], high[1]), low])
        axes.set(
            xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal", xticks=[], yticks=[]
        )
        axes.spines[:].set(visible=True, color=_FRAME)

        name = "reference" if run is None else wrapped(run.path.stepper, width=width)
        # Its last line is that of the error, which changes.
        axes.set_title(f"{name}\n", loc="left", parse_math=False)
        self.error = axes.text(0, 1.03, "", transform=axes.transAxes, animated=True)
        self.bar = _round_up(2 * half[0] * _LONGEST_BAR / 2.5)
        ends = [low[0], low[0] + self.bar]
        axes.plot(ends, [low[1]] * 2, color="0.2", linewidth=3, clip_on=False)
        below = {"y": -0.03, "va": "top", "fontsize": 8.0, "transform": axes.transAxes}
        below["animated"] = True
        self.scale = axes.text(0.0, s=" ", **below)
        self.larger = axes.text(1.0, s="", ha="right", weight="bold", color=colour, **below)

    def show(self, sample: int) -> None:
        """Show the sample, or the last that there is."""
        last = min(sample, len(self.shown) - 1)
        zoom, inside = self.zooms[last], sample < len(self.truth)

        def place(line: Any, points: np.ndarray | None) -> None:
            placed = np.empty((0, 2)) if points is None else points
            line.set_data(*((placed - self.middle) / zoom + self.middle).T)

        place(self.trace, self.shown[: last + 1, self.node])
        place(self.box, self.corners if zoom > 1 else None)
        length = zoom * self.bar
        self.scale.set_text(f"{_short(length)} {unit_of(self.paths.problem, 'position')}")
        if self.run is None:
            # Outside its horizon the reference is no truth, so that none is shown.
            place(self.nodes, self.shown[last] if inside else None)
            self.error.set_text(_reference_words(self.paths, sample))
            return
        place(self.behind, self.truth[sample] if inside else None)
        place(self.nodes, self.shown[last])
        self.error.set_text(_run_words(self.paths, self.run.path, sample))
        known = sample < len(self.run.path.differences)
        larger = {"errors": self.run.times_error if known else 1.0, "view": zoom}
        self.larger.set_text(
            ", ".join(f"{name} × {_short(times)}" for name, times in larger.items() if times > 1)
        )


def _trusted(paths: NodePaths) -> np.ndarray:
    """The reference's nodes in the plane of the film."""
    return paths.reference.positions[: paths.reference.trusted, :, :2]


def _size(truth: np.ndarray) -> float:
    return float(np.max(np.ptp(truth.reshape(-1, 2), axis=0))) or 1.0


def _magnification(paths: NodePaths, errors: np.ndarray) -> float:
    """The power of ten that makes errors as large as can be well seen; 1 where they are anyway.

    Errors that the reference cannot tell stay too small to be seen.
    """
    size, largest = _size(_trusted(paths)), float(np.max(np.abs(errors)))
    bound = float(paths.reference.certificate.bounds["position"][paths.reference.trusted - 1])
    needed = max(largest / _LARGEST_ERROR, bound / _UNSEEN) / size
    return 10.0 ** math.floor(-math.log10(needed)) if 0 < needed < 1 else 1.0


def _view(truth: np.ndarray, runs: list[_Run]) -> tuple[np.ndarray, np.ndarray]:
    """The middle of the view that all panels begin with, and half its size."""
    corners, size = truth.reshape(-1, 2), _size(truth)
    low, high = np.min(corners, axis=0), np.max(corners, axis=0)
    drawn, away = [run.shown.reshape(-1, 2) for run in runs], _FURTHEST * size
    near = [each for each in drawn if np.all((each >= low - away) & (each <= high + away))]
    shown = np.concatenate([corners, *near])
    low, high = np.min(shown, axis=0), np.max(shown, axis=0)
    width, height = high - low + 2 * _MARGIN * size
    half = np.array([max(width, height / _STEEPEST), max(height, width * _FLATTEST)]) / 2
    return (low + high) / 2, half


def _traced(paths: NodePaths) -> int:
    """The last node; where that does not move, the one that gets furthest from its start."""
    trusted = paths.reference.positions[: paths.reference.trusted]
    away = np.max(np.linalg.norm(trusted - trusted[0], axis=2), axis=0)
    return len(away) - 1 if away[-1] > 0 else int(np.argmax(away))


def _round_up(number: float) -> float:
    """The next of 1, 2, 5, 10, 20, 50, ..."""
    power = 10.0 ** math.floor(math.log10(number))
    return next(step * power for step in (1, 2, 5, 10) if number <= step * power * (1 + 1e-12))


def _short(number: float) -> str:
    """A round number in few letters."""
    return (
        f"{number:g}"
        if 1e-3 <= number < 1e6
        else f"{number:.0e}".replace("e+0", "e").replace("e+", "e")
    )


def _head(paths: NodePaths, width: float) -> str:
    """The problem and the step size, and room for the time."""
    flat = ", x and y of 3 components" if paths.reference.positions.shape[2] == 3 else ""
    per_frame = paths.steps_per_frame
    steps = "" if per_frame is None else f"; {counted(per_frame, 'step')}/frame"
    return wrapped(problem_words(paths.problem) + flat + steps, width=width) + "\n"


def _time_words(paths: NodePaths, sample: int) -> str:
    parts = paths.samples_per_frame
    return f"frame {sample / parts:.{0 if parts == 1 else 2}f} of {paths.problem.frames}"


def _reference_words(paths: NodePaths, sample: int) -> str:
    if sample < paths.reference.trusted:
        return f"bound {paths.reference.bound(paths.norm)[sample]:.1e}"
    return f"ended: trusted before frame {paths.reference.trusted / paths.samples_per_frame:g}"


def _run_words(paths: NodePaths, path: NodePath, sample: int) -> str:
    """The error as a table's cell has it, if there is a reference."""
    if sample >= len(path.positions):
        return f"{path.status} at frame {path.diverged_at}"
    if sample >= len(path.errors):
        return "error unknown: no reference"
    error, resolution = path.errors[sample], paths.resolution[sample]
    return f"error {error:.2e}" if error >= resolution else f"error < {resolution:.1e}"
