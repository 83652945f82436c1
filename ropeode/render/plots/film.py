"""The pictures of a film: the nodes of a reference and of runs, side by side."""

from __future__ import annotations

import math
from collections.abc import Callable

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ropeode.render.plots.labels import with_unit
from ropeode.render.plots.style import STYLE, new_grid, stepper_style, wrapped
from ropeode.render.table_words import problem_words
from ropeode.study.node_paths import NodePath, NodePaths

DPI = 120
_PANEL_WIDTH, _LEAST_WIDTH, _MOST_COLUMNS = 2.6, 5.2, 3
_LINE_HEIGHT, _TITLE_HEIGHT, _FOOT_HEIGHT, _LABEL_WIDTH, _GAP = 0.19, 0.5, 0.6, 0.55, 0.1
# Height over width of a panel, at least and at most.
_FLATTEST, _STEEPEST = 0.5, 1.4
_MARGIN = 0.08
# The view follows runs that leave the reference's room by no more than this part of its size.
_FURTHEST = 0.2
# A node that is this many sizes away from the view is not drawn, nor what joins it to others.
_OUT_OF_SIGHT = 3.0
_REFERENCE_COLOUR = "0.2"

ShowSample = Callable[[int], None]


@matplotlib.rc_context(STYLE)
def film(paths: NodePaths) -> tuple[Figure, ShowSample]:
    """A figure, and a function that makes it show the sample with an index.

    Arguments:
        paths: from `ropeode.node_paths`.
    """
    low, high = _view(paths)
    count = 1 + len(paths.paths)
    columns = 2 if count == 4 else min(count, _MOST_COLUMNS)
    rows = math.ceil(count / columns)
    width = max(_LEAST_WIDTH, columns * _PANEL_WIDTH)
    panel_width = (width - _LABEL_WIDTH) / columns - _GAP
    panel_height = panel_width * (high - low)[1] / (high - low)[0]
    head_height = _LINE_HEIGHT * len(_head(paths, 0, width).splitlines())
    height = head_height + rows * (_TITLE_HEIGHT + panel_height) + _FOOT_HEIGHT
    figure = Figure(figsize=(width, height), dpi=DPI, layout="constrained")
    title = figure.suptitle("", x=0.02, ha="left", parse_math=False)
    x, y = (with_unit(name, paths.problem, "position") for name in "xy")
    grid = new_grid(figure, rows, columns, count, (x, y))
    for axes in grid:
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")

    trusted = paths.reference.positions[: paths.reference.trusted]
    draw = _Nodes(paths, low, high)
    reference = draw(grid[0], trusted, _REFERENCE_COLOUR)
    runs = [
        draw(axes, path.positions, stepper_style(index)[0])
        for index, (axes, path) in enumerate(zip(grid[1:], paths.paths, strict=True))
    ]

    # Kept, because a title that is set anew takes on the user's settings.
    over_reference, *over_runs = [axes.set_title("", loc="left") for axes in grid]

    def show(sample: int) -> None:
        title.set_text(_head(paths, sample, width))
        # Outside its horizon the reference is no truth, so that none is shown.
        reference(sample, sample < len(trusted))
        over_reference.set_text(f"reference\n{_reference_words(paths, sample)}")
        for over, run, path in zip(over_runs, runs, paths.paths, strict=True):
            run(sample, True)
            name = wrapped(path.stepper, width=panel_width)
            over.set_text(f"{name}\n{_run_words(paths, path, sample)}")

    # Laid out once, so that nothing moves but the nodes.
    show(0)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    return figure, show


class _Nodes:
    """Draws nodes and the trace of one of them.

    Arguments:
        paths: to be drawn.
        low: lower left corner of the view.
        high: upper right corner.
    """

    def __init__(self, paths: NodePaths, low: np.ndarray, high: np.ndarray):
        size = _OUT_OF_SIGHT * (high - low)
        self.room = low - size, high + size
        self.node = _traced(paths)
        mechanics = paths.problem.mechanics
        in_a_row = mechanics is not None and mechanics.links is not None
        self.joined = "-" if in_a_row else "none"

    def __call__(
        self, axes: Axes, positions: np.ndarray, colour: str
    ) -> Callable[[int, bool], None]:
        """A function that shows a sample of `positions`, ``(samples, nodes, dim)``, or the last."""
        shown = positions[..., :2]
        near = np.all((shown >= self.room[0]) & (shown <= self.room[1]), axis=-1, keepdims=True)
        shown = np.where(near, shown, np.nan)
        (trace,) = axes.plot([], [], color=colour, alpha=0.45, linewidth=0.8)
        (nodes,) = axes.plot(
            [], [], color=colour, linestyle=self.joined, linewidth=1.4, marker="o", markersize=3
        )

        def show(sample: int, nodes_too: bool) -> None:
            last = min(sample, len(shown) - 1)
            nodes.set_data(*(shown[last].T if nodes_too else ([], [])))
            trace.set_data(*shown[: last + 1, self.node].T)

        return show


def _view(paths: NodePaths) -> tuple[np.ndarray, np.ndarray]:
    """The corners of the view, the same in all panels."""
    trusted = paths.reference.positions[: paths.reference.trusted, :, :2].reshape(-1, 2)
    low, high = np.min(trusted, axis=0), np.max(trusted, axis=0)
    size = float(np.max(high - low)) or 1.0
    runs = np.concatenate([each.positions[..., :2].reshape(-1, 2) for each in paths.paths])
    near = np.all((runs >= low - _FURTHEST * size) & (runs <= high + _FURTHEST * size), axis=1)
    shown = np.concatenate([trusted, runs[near]])
    low, high = np.min(shown, axis=0), np.max(shown, axis=0)
    middle, (width, height) = (low + high) / 2, high - low + 2 * _MARGIN * size
    half = np.array([max(width, height / _STEEPEST), max(height, width * _FLATTEST)]) / 2
    return middle - half, middle + half


def _traced(paths: NodePaths) -> int:
    """The last node; where that does not move, the one that gets furthest from its start."""
    trusted = paths.reference.positions[: paths.reference.trusted]
    away = np.max(np.linalg.norm(trusted - trusted[0], axis=2), axis=0)
    return len(away) - 1 if away[-1] > 0 else int(np.argmax(away))


def _head(paths: NodePaths, sample: int, width: float) -> str:
    """The problem, the step size and the time."""
    problem, parts = paths.problem, paths.samples_per_frame
    now = f"frame {sample / parts:.{0 if parts == 1 else 2}f} of {problem.frames}"
    flat = ", x and y of 3 components" if paths.reference.positions.shape[2] == 3 else ""
    steps = "" if paths.steps_per_frame is None else f"{paths.steps_per_frame} steps/frame"
    return f"{wrapped(problem_words(problem) + flat, steps, width=width)}, {now}"


def _reference_words(paths: NodePaths, sample: int) -> str:
    if sample < paths.reference.trusted:
        return f"bound {paths.reference.bound(paths.norm)[sample]:.1e}"
    return f"ended: trusted before frame {paths.reference.trusted / paths.samples_per_frame:g}"


def _run_words(paths: NodePaths, path: NodePath, sample: int) -> str:
    """The error as a table's cell has it, if there is a reference."""
    if sample >= len(path.positions):
        return f"diverged at frame {path.diverged_at}"
    if sample >= len(path.errors):
        return "error unknown: no reference"
    error, resolution = path.errors[sample], paths.resolution[sample]
    return f"error {error:.2e}" if error >= resolution else f"error < {resolution:.1e}"
