"""Energy against time."""

from __future__ import annotations

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from ropeode.render.plots.labels import with_unit
from ropeode.render.plots.panels import draw_legend, new_panels
from ropeode.render.plots.style import STYLE
from ropeode.render.plots.time_axes import draw_ends, draw_horizon
from ropeode.study.curves import EnergyCurves

# A run has blown up that is further away than the reference's energy changes by itself, and
# than this part of its size.
_FURTHEST = 0.1
_MARGIN = 0.08


@matplotlib.rc_context(STYLE)
def plot_energies(curves: EnergyCurves) -> Figure:
    """Energy against time for each run, and for the reference inside its trust horizon.

    Arguments:
        curves: from `ropeode.energy_curves`.

    Returns:
        A matplotlib figure, 6.5 inches wide, with a panel for each stepper, or a single one
        where there is one number of steps per frame; time and energy in the problem's
        units. docs/plots.md says what each mark means.
    """
    label = with_unit("energy", curves.problem, "energy")
    figure, panels = new_panels(curves, "Energy", "", label)
    low, high = _limits(curves)
    for panel, axes in panels:
        axes.set_ylim(low, high)
        axes.plot(
            curves.times, curves.values, color="0.75", linewidth=4, zorder=1.8, label="reference"
        )
        draw_horizon(axes, curves.reference)
        for line in panel.lines:
            # What is out of sight is still a number that can be drawn.
            values = np.clip(line.curve.values, 2.0 * low - high, 2.0 * high - low)
            axes.plot(line.curve.times, values, color=line.colour, label=line.label)
            draw_ends(axes, line, values)
    draw_legend(figure, panels)
    return figure


def _limits(curves: EnergyCurves) -> tuple[float, float]:
    """The ends of the energy axis: no run that blew up stretches it."""
    low, high = float(np.min(curves.values)), float(np.max(curves.values))
    size = float(np.max(np.abs(curves.values)))
    furthest = max(high - low, _FURTHEST * size)
    numbers = np.concatenate([curves.values, *(each.values for each in curves.curves)])
    near = numbers[(numbers >= low - furthest) & (numbers <= high + furthest)]
    low, high = float(np.min(near)), float(np.max(near))
    # What stands still has a constant energy, which may be zero.
    margin = _MARGIN * (high - low) or 0.1 * size or 1.0
    return low - margin, high + margin
