"""The default rope as it falls, and three runs that should fall beside it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import matplotlib
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Text
from PIL import Image

from ropeode.problems.rope import Rope
from ropeode.render import STYLE
from ropeode.render.plots.style import stepper_style
from ropeode.study import NodePaths
from ropeode.study.node_paths import node_paths

# At the last one the rope hangs upright for a moment.
FRAMES = 32
EULER, PER_STEP = "explicit-euler", "stormer-verlet:damping=per-step"
NAMES = {EULER: "Explicit Euler", PER_STEP: "Verlet, damping per step"}
RUNS = ((EULER, 64), (PER_STEP, 64), (PER_STEP, 1024))

_SIZE, _DPI, _LETTERS = (9.6, 2.95), 100, 10.0
_ACROSS, _UP = (-440.0, 60.0), (-250.0, 250.0)
_DARK, _BEHIND = "0.2", "0.75"
# Pictures per second, and how long the last one stays.
FPS, _LAST = 20, 40


def falling_ropes() -> list[tuple[str, NodePaths]]:
    """The runs, each with the reference at the same times, and its title."""
    rope = Rope().problem(FRAMES)
    return [
        (f"{NAMES[stepper]}\n{steps} steps per frame", node_paths(rope, [stepper], steps))
        for stepper, steps in RUNS
    ]


def film_of_ropes(ropes: Sequence[tuple[str, NodePaths]]) -> Iterator[Image.Image]:
    """One picture for each sample: the reference, and beside it the runs, in front of it.

    Arguments:
        ropes: from `falling_ropes`.
    """
    with matplotlib.rc_context({**STYLE, "font.size": _LETTERS, "axes.titlesize": _LETTERS}):
        yield from _pictures(ropes)


def _pictures(ropes: Sequence[tuple[str, NodePaths]]) -> Iterator[Image.Image]:
    figure = Figure(figsize=_SIZE, dpi=_DPI)
    canvas = FigureCanvasAgg(figure)
    of_truth, *of_runs = figure.subplots(1, 1 + len(ropes))
    figure.subplots_adjust(left=0.01, right=0.99, bottom=0.1, top=0.83, wspace=0.06)
    for axes in (of_truth, *of_runs):
        axes.set(xlim=_ACROSS, ylim=_UP, aspect="equal", xticks=[], yticks=[])
        axes.spines[:].set(visible=True, color=_BEHIND)
    for axes, (title, _) in zip(of_runs, ropes, strict=True):
        axes.set_title(title, loc="left")
    truth = ropes[0][1].reference
    references = [_rope(of_truth, _DARK), *(_rope(axes, _BEHIND) for axes in of_runs)]
    runs = [_rope(axes, stepper_style(index)[0]) for index, axes in enumerate(of_runs)]
    bound, *errors = (_words(axes) for axes in (of_truth, *of_runs))
    for sample, time in enumerate(truth.times):
        of_truth.set_title(f"Reference\nframe {time:.0f}", loc="left")
        bound.set_text(f"error bound {truth.bound()[sample]:.0e}")
        for line in references:
            line.set_data(*truth.positions[sample].T)
        for line, error, (_, paths) in zip(runs, errors, ropes, strict=True):
            (path,) = paths.paths
            line.set_data(*path.positions[sample].T)
            error.set_text(f"error {path.errors[sample]:.3g}")
        canvas.draw()
        size = canvas.get_width_height()
        picture = Image.frombytes("RGB", size, canvas.buffer_rgba(), "raw", "RGBX")
        yield from [picture] * (_LAST if time == truth.times[-1] else 1)


def _rope(axes: Axes, colour: str) -> Line2D:
    return axes.plot([], [], "o-", color=colour, markersize=3, linewidth=1.4)[0]


def _words(axes: Axes) -> Text:
    return axes.text(0.0, -0.03, "", transform=axes.transAxes, va="top")
