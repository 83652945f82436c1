"""The energy error against time."""

from __future__ import annotations

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ropeode.render.plots.curves import Error, draw_curves
from ropeode.render.plots.labels import with_unit
from ropeode.render.plots.panels import draw_legend, new_panels
from ropeode.render.plots.style import STYLE
from ropeode.render.plots.time_axes import draw_horizon
from ropeode.study import EnergyCurves
from ropeode.validation import check_kind

_LESS = Line2D(
    [], [], color="0.3", linestyle="none", marker="o", markersize=3.5, markerfacecolor="white",
    label="hollow: less energy than the true one",
)  # fmt: skip


@matplotlib.rc_context(STYLE)
def plot_energies(curves: EnergyCurves) -> Figure:
    """How far the energy of each run is from the true one, against time.

    Arguments:
        curves: from `ropeode.energy_curves`.

    Returns:
        A matplotlib figure, 6.5 inches wide, with a panel for each stepper, or a single one
        where there is one number of steps per frame; time and energy (logarithmic) in the
        problem's units. docs/howto/plots.md says what each mark means.

    Examples:
        >>> from ropeode import Rope, energy_curves, plot_energies
        >>> curves = energy_curves(Rope(num_nodes=4).problem(frames=3), ["rk4"], [16])
        >>> plot_energies(curves).axes[0].get_xlabel()
        'time [frames]'
    """
    check_kind("curves", curves, EnergyCurves, "energy_curves")
    label = with_unit(r"$|E - E_{\rm true}|$", curves.problem, "energy")
    # At the first sample, each error is zero by definition.
    after = slice(1, None)
    errors = {
        id(each): Error(each.times[after][: len(found) - 1], found[after])
        for each in curves.curves
        if len(found := curves.errors(each))
    }
    figure, panels = new_panels(
        curves.problem, curves.curves, "Energy error", _true_energy(curves), label
    )
    size = float(np.max(np.abs(curves.values))) or np.inf
    shared = draw_curves(panels, curves.times[after], curves.bound[after], errors, size)
    if curves.reference is not None and not curves.conserved:
        for _, axes in panels:
            draw_horizon(axes, curves.reference)
    signs = any(np.any(each.values < 0) for each in errors.values())
    draw_legend(figure, panels, shared, [_LESS] if signs else [])
    return figure


def _true_energy(curves: EnergyCurves) -> str:
    start, end = curves.values[0], curves.values[-1]
    if curves.conserved:
        return f"true energy: {start:.4g} at all times; conserved wherever looked at"
    return f"true energy: that of the reference, {start:.4g} at first and {end:.4g} at last"
