"""Every float64 run's error against a truth in extended precision, over time."""

from __future__ import annotations

import math
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator, NullLocator

from ropeode.render.plots.against_time import draw_horizon
from ropeode.render.plots.labels import with_unit
from ropeode.render.plots.style import BAND, BAND_EDGE, STYLE, make_room, new_figure, stepper_style
from ropeode.render.table_words import problem_words
from ropeode.study import Horizon
from ropeode.validation import check_kind

_HEIGHT = 3.8
# In the order in which they are drawn: what matters most is on top.
_ROLES = (
    "looser",
    "tighter",
    "short steps",
    "close look",
    "neighbour",
    "rounding",
    "independent",
    "reference",
)
# Marks on each line, which stand at other times than those of the other lines.
_MARKS = 7


@matplotlib.rc_context(STYLE)
def plot_horizon(study: Horizon) -> Figure:
    """Errors of all float64 runs, the certificate's bound, the horizon and the growth.

    Arguments:
        study: from `ropeode.horizon`.

    Returns:
        A matplotlib figure, 6.5 inches wide; time in the problem's unit, errors (logarithmic)
        in that of its first quantity, and on the right the digits that are left.
        docs/explanation/horizon.md says what each line means.

    Examples:
        >>> from ropeode import Rope, horizon, plot_horizon
        >>> study = horizon(Rope(num_nodes=4).problem(frames=3), spans=[3.0])
        >>> plot_horizon(study).axes[0].get_ylabel()
        'error [length units]'
    """
    check_kind("study", study, Horizon, "horizon")
    truth = study.truth
    figure = new_figure(
        f"Float64 against extended precision: {problem_words(study.problem)}",
        f"truth: {truth.coarse.precision} and {truth.fine.precision} bits, known to t = "
        f"{study.times[-1]:g}",
        _HEIGHT,
    )
    axes = figure.subplots()
    low, high = _limits(study)
    axes.set(
        yscale="log",
        ylim=(low, high),
        xlim=(study.times[0], study.times[-1]),
        xlabel=with_unit("time", study.problem, "time"),
        ylabel=with_unit("error", study.problem, study.problem.quantities[0]),
    )
    times, shown = study.times[1:], study.bound[1:]
    axes.fill_between(times, low, np.minimum(shown, high), color=BAND, linewidth=0)
    axes.plot(times, shown, color=BAND_EDGE, linestyle="--", label="certificate's bound")
    runs = sorted(study.runs, key=lambda run: _ROLES.index(run.role))
    # Their colours and marks begin anew behind the looser ones, which are grey.
    looser = sum(run.role == "looser" for run in runs)
    for index, run in enumerate(runs):
        # A distance of zero is one below rounding.
        errors = np.where(np.isfinite(run.errors), np.maximum(run.errors, low), np.nan)
        every = max(1, len(times) // _MARKS)
        look = _look(run.role, index if index < looser else index - looser)
        label = f"{run.role}: {run.solver} {run.tolerance:.0e}"
        axes.plot(
            times, errors[1:], label=label, markevery=(index * every // len(runs), every), **look
        )
    _draw_growth(axes, study)
    draw_horizon(axes, study.reference)

    def digits_of(errors: Any) -> np.ndarray:
        return -np.log10(np.maximum(errors, 1e-300) / study.size)

    def errors_of(digits: Any) -> np.ndarray:
        return study.size * 10.0 ** -np.asarray(digits)

    digits = axes.secondary_yaxis("right", functions=(digits_of, errors_of))
    digits.set_ylabel("digits left")
    digits.yaxis.set_major_locator(MultipleLocator(2))
    digits.yaxis.set_major_formatter("{x:.0f}")
    digits.yaxis.set_minor_locator(NullLocator())
    figure.legend(loc="outside lower center", ncols=2, fontsize=7.5)
    make_room(figure, _HEIGHT, math.ceil(len(axes.get_legend_handles_labels()[1]) / 2))
    return figure


def _look(role: str, index: int) -> dict[str, Any]:
    """Looser runs are grey, each with a mark of its own; the reference is a broad line."""
    colour, marker = stepper_style(index)
    look: dict[str, Any] = {"marker": marker, "markersize": 3.5}
    if role == "looser":
        return {"color": "0.6", "linewidth": 0.8, "markerfacecolor": "white", **look}
    if role == "reference":
        return {"color": "black", "linewidth": 1.8, **look}
    return {"color": colour, **look}


def _limits(study: Horizon) -> tuple[float, float]:
    """From below the smallest error that is drawn to above the largest."""
    errors = np.concatenate([study.bound[1:], *(run.errors[1:] for run in study.runs)])
    some = errors[np.isfinite(errors) & (errors > 0)]
    rounding = study.size * np.finfo(np.float64).eps
    return (
        max(float(np.min(some, initial=rounding)), 1e-3 * rounding) / 3.0,
        3.0 * min(float(np.max(some, initial=rounding)), 10.0 * study.size),
    )


def _draw_growth(axes: Axes, study: Horizon) -> None:
    """A line of the growth that was measured, through the mean of the runs."""
    growth = study.float64_growth
    if growth is None:
        return
    inside = (study.times >= growth.start) & (study.times <= growth.end)
    times = study.times[inside]
    x = times if growth.law == "exponential" else np.log(times - study.times[0])
    logs = np.mean(
        [np.log(run.errors[inside]) for run in study.runs if run.role != "looser"], axis=0
    )
    line = np.exp(np.mean(logs) + growth.rate * (x - np.mean(x)))
    words = "rate" if growth.law == "exponential" else "power"
    axes.plot(
        times,
        line,
        color="0.2",
        linewidth=1.4,
        linestyle=(0, (1, 1.5)),
        label=f"{growth.law} growth, {words} {growth.rate:.2g}",
    )
