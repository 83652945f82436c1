"""Pictures of small steps against iterations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ropeode.render import STYLE, make_room, new_figure
from ropeode.render.plots.style import stepper_style

from .small_steps import Cheapest, Damped, OneRope, Splits

_SPLITS, _CHEAPEST, _DAMPING = 5.0, 3.0, 3.3
_MARK = 3.5
# A rate that is rounding.
_NOTHING = 1e-9
_TRUE: dict[str, Any] = {"lw": 0.8, "ls": (0, (6, 2, 1, 2))}


def _panels(ropes: Mapping[OneRope, object], which: int) -> list:
    """The different numbers of nodes (0) or stiffnesses (1)."""
    return list(dict.fromkeys(key[which] for key in ropes))


@matplotlib.rc_context(STYLE)
def plot_splits(found: Mapping[OneRope, Splits]) -> Figure:
    """Errors and stretch against sweeps per frame: all of them steps, or all of them iterations.

    Arguments:
        found: by nodes and stiffness.
    """
    figure = new_figure(
        "XPBD: n steps with one iteration, or one step with n iterations",
        "a rope of 400 length units falls for 20 frames; errors against a certified reference",
        _SPLITS,
    )
    stiffnesses = _panels(found, 1)
    grid = figure.subplots(2, len(stiffnesses), sharex=True, sharey="row", squeeze=False)
    for column, stiffness in zip(grid.T, stiffnesses, strict=True):
        column[0].set_title(f"stiffness {stiffness:g}")
        for index, nodes in enumerate(_panels(found, 0)):
            _draw_both(column, found[nodes, stiffness], index, nodes)
        column[1].set_xlabel("sweeps per frame")
    for axes in grid.ravel():
        axes.set_xscale("log", base=2)
        axes.set_yscale("log")
        axes.xaxis.set_major_formatter("{x:.0f}")
    grid[0, 0].set_ylabel("error of the tip [rope lengths]")
    grid[1, 0].set_ylabel("stretch of the longest link")
    for words, look in (("n steps, one iteration", "-"), ("one step, n iterations", ":")):
        grid[0, 0].plot([], [], color="0.3", ls=look, label=words)
    grid[0, 0].plot([], [], label="true stretch", **_TRUE, color="0.3")
    figure.legend(*grid[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    make_room(figure, _SPLITS, 2)
    return figure


def _draw_both(column: Sequence[Axes], of_rope: Splits, index: int, nodes: int) -> None:
    colour, marker = stepper_style(index)
    errors, stretch = column
    for small in (True, False):
        runs = [run for run in of_rope.runs if (run.iterations if small else run.steps) == 1]
        look = {"color": colour, "marker": marker, "ms": _MARK, "ls": "-" if small else ":"}
        label = f"{nodes} nodes" if small else None
        shown = [(run.sweeps, run.max) for run in runs if run.max is not None]
        errors.plot(*zip(*shown, strict=True), label=label, **look)
        shown = [(run.sweeps, run.stretch) for run in runs if run.stretch is not None]
        stretch.plot(*zip(*shown, strict=True), **look)
    stretch.axhline(of_rope.stretch, color=colour, **_TRUE)


@matplotlib.rc_context(STYLE)
def plot_cheapest(found: Mapping[OneRope, Sequence[Cheapest]]) -> Figure:
    """The time that each method needs for an error of a hundredth, against stiffness.

    Arguments:
        found: by nodes and stiffness.
    """
    figure = new_figure(
        "What it costs to keep the tip within 1% of the rope's length",
        "bars from the fastest to the slowest round",
        _CHEAPEST,
    )
    sizes = _panels(found, 0)
    grid = figure.subplots(1, len(sizes), sharey=True, squeeze=False)[0]
    for axes, nodes in zip(grid, sizes, strict=True):
        own = {k: rows for (n, k), rows in found.items() if n == nodes}
        for index, method in enumerate([row.method for row in next(iter(own.values()))]):
            colour, marker = stepper_style(index)
            timed = [
                (stiffness, [1e6 * each for each in row.seconds])
                for stiffness, rows in own.items()
                for row in rows
                if row.method == method and row.seconds is not None
            ]
            x, y = [k for k, _ in timed], [middle for _, (middle, _, _) in timed]
            axes.plot(x, y, color=colour, marker=marker, ms=_MARK, label=method)
            for k, (_, low, high) in timed:
                axes.plot([k, k], [low, high], color=colour, lw=0.7, alpha=0.6)
        axes.set_title(f"{nodes} nodes")
        axes.set(xscale="log", yscale="log", xlabel="stiffness")
    grid[0].set_ylabel("time of a frame [µs]")
    figure.legend(*grid[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    make_room(figure, _CHEAPEST, 3)
    return figure


@matplotlib.rc_context(STYLE)
def plot_damping(found: Sequence[Damped]) -> Figure:
    """The damping of the slowest swing, and its frequency, against steps per frame.

    Arguments:
        found: from `damping_rates`.
    """
    figure = new_figure(
        "What methods add to the slowest swing of a rope without damping",
        "marks: runs; lines: eigenvalues of the methods' own steps",
        _DAMPING,
    )
    rates, speeds = figure.subplots(1, 2)
    for index, method in enumerate(dict.fromkeys(each.method for each in found)):
        colour, marker = stepper_style(index)
        own = [each for each in found if each.method == method]
        steps = [each.steps for each in own]
        mark: dict[str, Any] = {"color": colour, "marker": marker, "ms": _MARK}
        if not index:
            # Others lie upon it.
            mark |= {"ms": 3 * _MARK, "mfc": "none"}
        speeds.plot(steps, [each.speed for each in own], label=method, **mark)
        if max(each.of_step for each in own) > _NOTHING:
            rates.plot(steps, [each.of_step for each in own], color=colour)
            rates.plot(steps, [each.measured for each in own], ls="", **mark)
    rates.set_ylabel("loss of amplitude [1/frame]")
    rates.set_yscale("log")
    speeds.set_ylabel("frequency over the true one")
    for axes in (rates, speeds):
        axes.set_xscale("log", base=2)
        axes.xaxis.set_major_formatter("{x:.0f}")
        axes.set_xlabel("steps per frame")
    speeds.legend(loc="lower right")
    return figure
