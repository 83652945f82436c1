"""Pictures of the studies of the rope report's open questions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ropeode.render import STYLE, new_figure
from ropeode.render.plots.style import stepper_style

from .growth import MeasuredGrowth
from .local_errors import LocalErrors, Propagated
from .projection_sweeps import SweepStudy
from .rest_time import RestTime

# By peer, by size of the problem: the median of time over time, its minimum and its maximum.
Besides = dict[str, dict[str, list[tuple[float, float, float]]]]

_HEIGHT = 3.4
_MIDDLE = 8


@matplotlib.rc_context(STYLE)
def plot_sweeps(study: SweepStudy) -> Figure:
    """Error and broken lengths of constraint Verlet against step size, for each sweep count.

    Arguments:
        study: from `sweep_study`.
    """
    figure = new_figure(
        "Constraint Verlet: one sweep over the links, or many",
        f"{study.reference.problem.name}, {study.reference.problem.frames} frames; errors against "
        f"a reference good to {study.reference.bound()[-1]:.0e} length units",
        _HEIGHT,
    )
    errors, lengths = figure.subplots(1, 2)
    for index, each in enumerate(study.swept):
        colour, marker = stepper_style(index)
        label = f"{each.sweeps} sweep{'s' if each.sweeps > 1 else ''}"
        resolved = [(dt, e) for dt, e in zip(each.dts, each.errors, strict=True) if e is not None]
        errors.plot(*zip(*resolved, strict=True), color=colour, marker=marker, ms=3.5, label=label)
        lengths.plot(each.dts, each.violations, color=colour, marker=marker, ms=3.5)
    errors.set_ylabel("error of the worst node [length units]")
    lengths.set_ylabel("error of the worst link [its length]")
    for axes in (errors, lengths):
        axes.set_xlabel("dt [frames]")
        axes.set_xscale("log", base=2)
        axes.set_yscale("log")
        axes.xaxis.set_major_formatter(lambda dt, _: f"1/{1 / dt:.0f}")
    _slope(errors, study.swept[0].dts, study.swept[0].errors[-1], 1)
    _slope(lengths, study.swept[0].dts, study.swept[-1].violations[-1], 2)
    errors.legend(loc="upper left")
    return figure


def _slope(axes: Axes, dts: Sequence[float], at_finest: float | None, order: int) -> None:
    """A dashed line of a slope, below the finest point."""
    if at_finest is None:
        return
    dt = np.array(dts)
    line = 0.4 * at_finest * (dt / dt.min()) ** order
    axes.plot(dt, line, color="0.4", ls="--", lw=0.8)
    middle = len(dt) // 2
    axes.annotate(
        f"order {order}",
        (dt[middle], line[middle]),
        textcoords="offset points",
        xytext=(6, -8),
        color="0.3",
        fontsize=7.5,
    )


@matplotlib.rc_context(STYLE)
def plot_rest_times(times: Sequence[RestTime]) -> Figure:
    """The frame of coming to rest against steps per frame, and times the damping rate.

    Arguments:
        times: from `rest_times`, of any ropes and rules.
    """
    figure = new_figure(
        "When the Verlet ropes come to rest",
        "damping as a factor per step, as in the report, and as the same factor per time",
        _HEIGHT,
    )
    frames, products = figure.subplots(1, 2)
    kinds = list(dict.fromkeys((each.rope, each.rule) for each in times))
    names = {"constraint": "rigid links", "force": "springs"}
    rules = {"per-step": "per step", "lagged": "per time"}
    for index, (rope, rule) in enumerate(kinds):
        colour, marker = stepper_style(index)
        own = [e for e in times if (e.rope, e.rule) == (rope, rule) and e.settled_at is not None]
        steps = [each.steps_per_frame for each in own]
        # Both ropes do nearly the same; the second one's line must not hide the first.
        look = {"color": colour, "marker": marker, "ls": "-" if rope == "constraint" else ":"}
        frames.plot(
            steps, [e.settled_at for e in own], label=f"{names[rope]}, {rules[rule]}", **look
        )
        products.plot(steps, [e.product for e in own], **look)
    for axes in (frames, products):
        axes.set_xlabel("steps per frame")
        axes.set_xscale("log", base=2)
        axes.xaxis.set_major_formatter("{x:.0f}")
    frames.set_ylabel("at rest from frame")
    frames.set_yscale("log", base=2)
    frames.yaxis.set_major_formatter("{x:.0f}")
    products.set_ylabel("that frame times damping per frame")
    products.set_ylim(0, 20)
    products.legend(*frames.get_legend_handles_labels(), loc="lower center", fontsize=7.5)
    return figure


@matplotlib.rc_context(STYLE)
def plot_growth(scan: Sequence[MeasuredGrowth]) -> Figure:
    """Growth rate of a disturbance against steps per frame: theory as lines, runs as points.

    Arguments:
        scan: from `growth_scan`.
    """
    figure = new_figure(
        "What becomes of a small disturbance of the hanging rope",
        "above zero it grows: lines are eigenvalues of the stepper's own step, points are runs",
        _HEIGHT,
    )
    axes = figure.subplots()
    for index, name in enumerate(dict.fromkeys(each.stepper for each in scan)):
        colour, marker = stepper_style(index)
        own = [each for each in scan if each.stepper == name]
        steps = [each.steps_per_frame for each in own]
        axes.plot(steps, [each.predicted for each in own], color=colour)
        axes.plot(steps, [each.measured for each in own], marker, color=colour, label=name)
    axes.axhline(0.0, color="0.3", lw=0.8)
    axes.set_xscale("log", base=2)
    axes.set_yscale("symlog", linthresh=1e-3)
    axes.set_ylim(-0.03, 50.0)
    axes.set(xlabel="steps per frame", ylabel="growth rate [1/frame]")
    axes.legend()
    return figure


@matplotlib.rc_context(STYLE)
def plot_local_errors(found: Sequence[LocalErrors]) -> Figure:
    """The error of one step against its size.

    Arguments:
        found: from `local_errors`.
    """
    figure = new_figure(
        "The error of one step",
        "default rope at twelve random states; largest component",
        _HEIGHT,
    )
    axes = figure.subplots()
    for index, each in enumerate(found):
        colour, marker = stepper_style(index)
        label = f"{each.label}: order {each.order}"
        axes.plot(each.dts, each.errors, color=colour, marker=marker, ms=3.5, label=label)
    axes.set_xscale("log", base=2)
    axes.set_yscale("log")
    axes.set_ylim(1e-14, 1e3)
    axes.xaxis.set_major_formatter(lambda dt, _: f"1/{1 / dt:.0f}")
    axes.set(xlabel="dt [frames]", ylabel="error after one step [length units]")
    axes.legend(loc="lower right", fontsize=7.5)
    return figure


@matplotlib.rc_context(STYLE)
def plot_propagated(found: Sequence[Propagated]) -> Figure:
    """Predicted and measured error over the power of dt, as time goes on.

    Arguments:
        found: from `propagated`, one panel each.
    """
    figure = new_figure(
        "Predicted from single steps (lines), measured in runs (points)",
        "default rope; horizontal error of a node in its middle, over dt to the order",
        _HEIGHT,
    )
    for panel, each in zip(figure.subplots(1, len(found)), found, strict=True):
        panel.plot(each.predicted.times, each.predicted.states[:, 0, 0, _MIDDLE], color="0.2")
        for index, (steps, error) in enumerate(each.runs.items()):
            colour, marker = stepper_style(index)
            look = {"color": colour, "marker": marker, "ms": 3.5, "ls": ""}
            panel.plot(
                each.predicted.times, error[:, 0, 0, _MIDDLE], label=f"{steps} steps", **look
            )
        panel.set_title(f"{each.label}, order {each.predicted.order}", fontsize=7)
        panel.set_xlabel("time [frames]")
        panel.legend(fontsize=7)
    return figure


@matplotlib.rc_context(STYLE)
def plot_besides(panels: Mapping[str, Besides]) -> Figure:
    """The times of peers over those of ropeode, a line for each peer.

    Arguments:
        panels: by title, from the top.
    """
    lines = [len(peers) for peers in panels.values()]
    figure = new_figure(
        "Time of each peer over that of ropeode, in every case",
        "right of 1 ropeode is faster; bars from the smallest to the largest ratio of a round",
        0.9 + 0.45 * len(lines) + 0.24 * sum(lines),
    )
    grid = figure.subplots(len(panels), 1, sharex=True, height_ratios=[n + 0.6 for n in lines])
    for axes, (title, peers) in zip(grid, panels.items(), strict=True):
        sizes = list(dict.fromkeys(size for of_peer in peers.values() for size in of_peer))
        for line, of_peer in enumerate(peers.values()):
            every = [(size, each) for size, found in of_peer.items() for each in found]
            # Cases one below the other, within the height of their peer's line.
            for at, (size, (middle, low, high)) in zip(
                np.linspace(-0.3, 0.3, len(every) + 2)[1:-1], every, strict=True
            ):
                colour, marker = stepper_style(sizes.index(size))
                axes.plot([low, high], [line + at] * 2, color=colour, lw=0.7, alpha=0.6)
                axes.plot(middle, line + at, marker, color=colour, ms=3.2)
        for index, size in enumerate(sizes):
            colour, marker = stepper_style(index)
            axes.plot([], [], marker, color=colour, ms=3.2, label=size)
        axes.set_title(title, loc="left", fontsize=8)
        axes.set_yticks(range(len(peers)), list(peers))
        axes.set_ylim(len(peers) - 0.4, -0.6)
        axes.grid(axis="y", visible=False)
        axes.axvline(1.0, color="0.2", lw=0.9)
        if len(sizes) > 1:
            axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=7)
    grid[-1].set_xscale("log")
    grid[-1].xaxis.set_major_formatter("{x:g}")
    grid[-1].set_xlabel("time of the peer / time of ropeode")
    return figure
