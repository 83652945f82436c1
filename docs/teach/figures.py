"""The figures of the slides, as SVG: one command writes them all.

    python -m docs.teach.figures DIR [FIGURE ...]   (make figures)

Each is as wide and as high as a slide, 16 to 9, and fills one; there the letters have 20 points
and more. They are drawn as paths, so that they look the same everywhere. The colours are those of
the lab and of the other plots. With names, only those figures are written. Once JAX has compiled
everything, all of them take half a minute of processor time.
"""

from __future__ import annotations

import functools
import re
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.ticker import MultipleLocator

from docs.studies.growth import growth_scan
from docs.studies.plots import plot_growth, plot_rest_times, plot_sweeps
from docs.studies.projection_sweeps import sweep_study
from docs.studies.rest_time import rest_times
from ropeode import (
    InputError,
    Reference,
    Rope,
    accuracy_table,
    energy_curves,
    error_curves,
    explain_stepper,
    plot_convergence,
    plot_energies,
    plot_errors,
    plot_stability,
    reference,
    simulate,
)
from ropeode.files import make_folder, write_whole
from ropeode.precision import in_float64
from ropeode.progress import Progress
from ropeode.render import STYLE, figure_bytes
from ropeode.render.plots.style import Picture, stepper_style
from ropeode.terminal import end_on_ctrl_c, set_up_jax, show_progress
from ropeode.theory import StabilityFunction, stability_function_of
from ropeode.validation import bad_value

# In inches. The plots' letters of 8 to 9 points are large on so small a page.
SLIDE = (5.33, 3.0)
# Letters in a line of a legend beside the axes.
_NARROW = 26
# What is drawn of the true motion, as in the lab.
_TRUTH: Any = {"color": "0.6", "linewidth": 3.0, "solid_capstyle": "round"}
_DASHES: Any = ("-", (0, (4, 1.5)), (0, (1.5, 1.5)), (0, (6, 1.5, 1.5, 1.5)))
_PLACE = "{} [length units]"
EULER = ("explicit-euler", "semi-implicit-euler")
# Steps per frame of the ropes that come to rest.
REST = (64, 128, 256, 512)


def slide(figure: Figure, title: str) -> Figure:
    """A figure of ropeode, made as small as a slide is with letters of its size.

    Arguments:
        figure: of any size.
        title: in place of its own, in one line.
    """
    figure.set_size_inches(*SLIDE)
    figure.suptitle(title, fontsize=11, parse_math=False)
    for legend in figure.legends:
        handles, texts = legend.legend_handles, [text.get_text() for text in legend.get_texts()]
        legend.remove()
        shown = [(h, narrow(text)) for h, text in zip(handles, texts, strict=True) if text]
        figure.legend(*zip(*shown, strict=True), loc="outside right center", handlelength=1.6)
    for text in figure.findobj(Text):
        text.set_fontsize(max(text.get_fontsize(), STYLE["legend.fontsize"]))
    return figure


def narrow(label: str) -> str:
    """In short lines, which end behind a colon, and else behind a space or a comma."""
    lines = []
    for sentence in " ".join(label.split()).split(": "):
        lines.append("")
        for part in re.split(r"(?<=[ ,])", sentence):
            if len(lines[-1] + part.rstrip()) > _NARROW:
                lines.append("")
            lines[-1] += part
        lines[-1] += ":"
    return "\n".join(line.strip() for line in lines).removesuffix(":")


def empty(title: str, panels: int = 1) -> tuple[Figure, Sequence[Axes]]:
    """A slide without anything drawn on it."""
    figure = Picture(figsize=SLIDE, layout="constrained")
    figure.suptitle(title, fontsize=11)
    return figure, list(figure.subplots(1, panels, squeeze=False).ravel())


@functools.cache
def default_rope() -> Reference:
    """The default rope over 20 frames, solved."""
    return reference(Rope().problem(20))


@functools.cache
def undamped_rope() -> Reference:
    """The rope without damping, over as many frames as it can be trusted and some more."""
    return reference(Rope(damping=0.0).problem(160))


def first_order_plot() -> Figure:
    """Three methods, three slopes."""
    steppers = ["semi-implicit-euler", "stormer-verlet", "rk4"]
    table = accuracy_table(default_rope(), steppers, [16, 32, 64, 128])
    return slide(plot_convergence(table), "The slope is the order")


def three_verlets() -> Figure:
    """One formula, with three starts and dampings."""
    steppers = [
        "stormer-verlet",
        "stormer-verlet:start=rest",
        "stormer-verlet:start=rest,damping=per-step",
    ]
    table = accuracy_table(Rope(damping=5e-5).problem(20), steppers, [32, 64, 128, 256])
    return slide(plot_convergence(table), "Three Verlets, one formula")


def explosion() -> Figure:
    """How the rope flies apart within two frames, by one Euler method and not by the other."""
    truth, shown, steps = undamped_rope(), (7, 8, 9), 64
    figure, panels = empty(f"Two frames in the life of explicit Euler, {steps} steps per frame", 3)
    runs = [simulate(Rope(damping=0.0).problem(max(shown)), name, steps) for name in EULER]
    for axes, frame in zip(panels, shown, strict=True):
        axes.plot(*truth.states[frame, 0], label="true", **_TRUTH)
        for index, run in enumerate(runs):
            colour, marker = stepper_style(index)
            look = {"color": colour, "marker": marker, "markersize": 3, "linewidth": 0.9}
            axes.plot(*run.states[frame, 0], label=run.stepper.label, zorder=3 - index, **look)
        axes.set(
            xlim=(-450, 50), ylim=(100, 260), xlabel=_PLACE.format("x"), title=f"frame {frame}"
        )
        axes.xaxis.set_major_locator(MultipleLocator(200))
    panels[0].set_ylabel(_PLACE.format("y"))
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    for axes in panels[1:]:
        axes.tick_params(labelleft=False)
    return figure


def growth() -> Figure:
    """How fast a disturbance grows, by theory and in runs."""
    scan = growth_scan()
    return slide(plot_growth(scan), "Above zero a small disturbance grows")


def amplification() -> Figure:
    """By what factor an oscillation grows in a step, against dt omega."""
    figure, (axes,) = empty("By how much one step stretches an oscillation")
    z = np.linspace(0.0, 3.2, 641)[1:]
    for index, name in enumerate((*EULER, "stormer-verlet", "rk4")):
        function = stability_function_of(Rope().problem(1), name)
        assert isinstance(function, StabilityFunction), function
        look = {"color": stepper_style(index)[0], "linewidth": 1.8, "linestyle": _DASHES[index]}
        axes.plot(z, function.radius(1j * z), label=name, **look)
    axes.axhline(1.0, color="0.3", linewidth=0.8)
    axes.set(xlim=(0, z[-1]), ylim=(0.6, 2.0), xlabel="dt ω", ylabel="factor per step")
    axes.legend(loc="upper left")
    return figure


def stability_of_explicit_euler() -> Figure:
    """The region of stability, and the rope's frequencies times dt."""
    explained = explain_stepper("explicit-euler", default_rope())
    return slide(plot_stability(explained, [8, 16, 32]), "Explicit Euler: the rope is outside")


def stability_of_rk4() -> Figure:
    """The region of stability, and the rope's frequencies times dt."""
    explained = explain_stepper("rk4", default_rope())
    return slide(plot_stability(explained, [4, 8, 16]), "RK4: the rope is inside from 8 steps on")


def energy() -> Figure:
    """The energy of three methods over 300 frames."""
    steppers = ["semi-implicit-euler", "stormer-verlet", "rk4"]
    curves = energy_curves(Rope(damping=0.0).problem(300), steppers, [64])
    return slide(plot_energies(curves), "Energy over 300 frames, 64 steps per frame")


def local_and_global() -> Figure:
    """The error of one step beside that of a run, which begin at the same state."""
    names, ladder = ["semi-implicit-euler", "velocity-verlet", "rk4"], (16, 32, 64, 128, 256)
    figure, panels = empty("One power of dt is lost on the way", 2)
    problem = default_rope().problem
    start = problem.changed(y0=default_rope().states[10], ts=problem.ts[:11])
    one_step = [
        accuracy_table(start.changed(ts=np.array([0.0, 1.0 / steps])), names, [1])
        for steps in ladder
    ]
    for axes, tables, words in (
        (panels[0], one_step, "after one step"),
        (panels[1], [accuracy_table(start, names, ladder)], "after 10 frames"),
    ):
        for index, name in enumerate(names):
            rows = [row for table in tables for row in table.rows if row.stepper == name]
            points = [(row.dt, row.error_max) for row in rows if row.error_max is not None]
            colour, marker = stepper_style(index)
            log_dt, log_error = np.log(points[1:]).T
            slope = np.polyfit(log_dt, log_error, 1)[0]
            look = {"color": colour, "marker": marker, "markersize": 4}
            axes.plot(*zip(*points, strict=True), label=f"{name}, slope {slope:.1f}", **look)
        axes.set(xlabel="dt [frames]", title=words, ylim=(1e-16, 10.0), yscale="log")
        axes.set_xscale("log", base=2)
        axes.xaxis.set_major_formatter(lambda dt, _: f"1/{1 / dt:.0f}")
        axes.legend(loc="lower right")
    panels[0].set_ylabel("error [length units]")
    return figure


def damping_per_step() -> Figure:
    """Where the end of the rope is, with a factor in each step."""
    problem = Rope(damping=5e-5).problem(60)
    truth = reference(problem)
    figure, (axes,) = empty("A factor in each step: each step size has its own damping")
    axes.plot(truth.times, truth.states[:, 0, 1, -1], label="true", **_TRUTH)
    for index, steps in enumerate((64, 256, 1024)):
        run = simulate(problem, "stormer-verlet:damping=per-step", steps)
        look = {"color": stepper_style(index)[0], "linestyle": _DASHES[index], "linewidth": 1.6}
        axes.plot(run.times, run.states[:, 0, 1, -1], label=f"{steps} steps/frame", **look)
    axes.set(xlabel="time [frames]", ylabel="height of the free end [length units]")
    axes.legend(loc="lower left")
    return figure


def round_off() -> Figure:
    """Where smaller steps stop helping."""
    ladder = [2**k for k in range(7, 16)]
    table = accuracy_table(default_rope(), ["stormer-verlet", "velocity-verlet"], ladder)
    return slide(plot_convergence(table), "Round-off: the floor depends on how it is written")


def constraint_sweeps() -> Figure:
    """One sweep over rigid links, or many."""
    study = sweep_study(sweeps=(1, 4, 16, 64), steps_per_frame=(16, 32, 64, 128, 256, 512))
    return slide(plot_sweeps(study), "More sweeps keep the links, not the order")


def rest_time() -> Figure:
    """When the rope comes to rest, with a factor per step and per time."""
    times = [
        each for rule in ("per-step", "lagged") for each in rest_times("constraint", rule, REST)
    ]
    return slide(plot_rest_times(times), "A factor per step: more steps, sooner at rest")


def horizon() -> Figure:
    """Errors on a chaotic rope, up to where the reference is trusted."""
    curves = error_curves(undamped_rope(), ["stormer-verlet", "rk4"], [64])
    return slide(plot_errors(curves), "Chaos: no number beyond the horizon")


FIGURES: dict[str, Callable[[], Figure]] = {
    each.__name__.replace("_", "-"): each
    for each in (
        first_order_plot,
        local_and_global,
        explosion,
        growth,
        amplification,
        stability_of_explicit_euler,
        stability_of_rk4,
        energy,
        three_verlets,
        damping_per_step,
        rest_time,
        round_off,
        horizon,
        constraint_sweeps,
    )
}


@in_float64
def write(folder: Path, names: Sequence[str], progress: Progress) -> None:
    """Write figures to a folder, each whole or not at all.

    Arguments:
        folder: is made if it does not exist.
        names: of `FIGURES`; all of them if there are none.
        progress: called with the name of the figure, and the fraction that is done.

    Raises:
        InputError: there is no figure of such a name, or the folder cannot be made.
    """
    for name in names:
        if name not in FIGURES:
            raise bad_value("figure", name, ", ".join(FIGURES), "leave it out to write all")
    make_folder(folder)
    chosen = names or list(FIGURES)
    for index, name in enumerate(chosen):
        progress(name, index / len(chosen))
        with matplotlib.rc_context(STYLE):
            figure = FIGURES[name]()
        write_whole(folder / f"{name}.svg", figure_bytes(figure, ".svg"))


def main(arguments: Sequence[str]) -> None:
    """Write the figures that are asked for."""
    if not arguments or arguments[0].startswith("-"):
        sys.exit((__doc__ or "").strip())
    end_on_ctrl_c("the figures that are done are kept")
    try:
        with show_progress() as progress:
            set_up_jax()
            write(Path(arguments[0]), arguments[1:], progress)
    except InputError as error:
        sys.exit(str(error))


if __name__ == "__main__":
    main(sys.argv[1:])
