"""Every float64 run's error against a truth in extended precision, over time."""

from __future__ import annotations

from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator, NullLocator

from ropeode.render.plots.labels import with_unit
from ropeode.render.plots.style import BAND, BAND_EDGE, COLOURS, STYLE, new_figure
from ropeode.render.plots.time_axes import draw_horizon
from ropeode.render.table_words import problem_words
from ropeode.study.horizon import Horizon

_HEIGHT = 4.6
# In the order in which they are drawn: what matters most is on top.
_LOOKS = {
    "looser": {"color": "0.75", "linewidth": 0.8},
    "tighter": {"color": COLOURS[2]},
    "short steps": {"color": COLOURS[3]},
    "close look": {"color": COLOURS[5]},
    "neighbour": {"color": COLOURS[4]},
    "rounding": {"color": COLOURS[5]},
    "independent": {"color": COLOURS[1]},
    "reference": {"color": COLOURS[0], "linewidth": 1.8},
}


@matplotlib.rc_context(STYLE)
def plot_horizon(study: Horizon) -> Figure:
    """Errors of all float64 runs, the certificate's bound, the horizon and the growth.

    Arguments:
        study: from `ropeode.horizon`.

    Returns:
        A matplotlib figure, 6.5 inches wide; time in the problem's unit, errors (logarithmic)
        in that of its first quantity, and on the right the digits that are left. docs/horizon.md
        says what each line means.
    """
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
    labelled: set[str] = set()
    for run in sorted(study.runs, key=lambda run: [*_LOOKS].index(run.role)):
        label = f"{run.role}: {run.solver} {run.tolerance:.0e}"
        if run.role == "looser":
            label = "looser runs"
        # A distance of zero is one below rounding.
        errors = np.where(np.isfinite(run.errors), np.maximum(run.errors, low), np.nan)
        axes.plot(times, errors[1:], label="_" if label in labelled else label, **_LOOKS[run.role])
        labelled.add(label)
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
    return figure


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
        color="black",
        linewidth=1.0,
        linestyle=(0, (6, 2)),
        label=f"{growth.law} growth, {words} {growth.rate:.2g}",
    )
