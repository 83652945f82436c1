"""Three programs with the formula of Verlet, which differ in their start and in their damping."""

from __future__ import annotations

import matplotlib
from matplotlib.figure import Figure

from ropeode.analysis import ObservedOrder
from ropeode.problems.rope import Rope
from ropeode.render import STYLE, new_figure, order_interval, problem_words
from ropeode.render.plots.style import stepper_style
from ropeode.study import AccuracyTable
from ropeode.study.accuracy_table import accuracy_table

VERLETS = {
    "stormer-verlet:start=rest": "started with x(−dt) = x(0)",
    "stormer-verlet": "started with Taylor's formula",
    "stormer-verlet:damping=per-step": "damped by a factor per step",
}
STEPS_PER_FRAME = (32, 64, 128, 256, 512)
# In inches, and in points to the right of a mark and below it.
_HEIGHT, _BELOW = 3.1, (8, -6)


def three_verlets() -> AccuracyTable:
    """Their errors on the default rope."""
    return accuracy_table(Rope().problem(frames=20), list(VERLETS), STEPS_PER_FRAME)


@matplotlib.rc_context(STYLE)
def plot_three_verlets(table: AccuracyTable) -> Figure:
    """Error against step size; each line says what it is, and its order.

    Arguments:
        table: from `three_verlets`.
    """
    figure = new_figure("Three Verlets, one formula", problem_words(table.problem), _HEIGHT)
    axes = figure.subplots()
    for index, each in enumerate(table.orders):
        colour, marker = stepper_style(index)
        own = [
            (row.dt, row.error_max)
            for row in table.rows
            if row.stepper == each.stepper and row.error_max is not None
        ]
        axes.plot(*zip(*own, strict=True), color=colour, marker=marker)
        axes.annotate(
            f"{VERLETS[each.stepper]}: {_order_words(each.order)}",
            own[-2],
            textcoords="offset points",
            xytext=_BELOW,
            va="top",
            color=colour,
        )
    axes.set(
        xscale="log",
        yscale="log",
        ylim=(1e-6, 1e3),
        xlabel="step size dt [frames]",
        ylabel="largest error [length units]",
    )
    axes.set_xticks([1 / n for n in STEPS_PER_FRAME], [f"1/{n}" for n in STEPS_PER_FRAME])
    axes.minorticks_off()
    return figure


def _order_words(order: ObservedOrder) -> str:
    if order.verdict != "converges":
        return order.verdict
    return f"order {order.observed:.2f} {order_interval(order)}"
