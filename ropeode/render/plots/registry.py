"""The types of plots, by name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from matplotlib.figure import Figure

from ropeode.render.plots.convergence import plot_convergence
from ropeode.render.plots.energy import plot_energies
from ropeode.render.plots.error import plot_errors
from ropeode.study.accuracy_table import accuracy_table
from ropeode.study.curves import EnergyCurves, energy_curves, error_curves


class Plot(NamedTuple):
    """A type of plot.

    Fields:
        study: called like `ropeode.accuracy_table`.
        draw: makes a figure of what `study` returns.
    """

    study: Callable[..., Any]
    draw: Callable[[Any], Figure]


def _energies(*given: Any, norm: str | None, **named: Any) -> EnergyCurves:
    """An energy is measured in no norm, which a spec may still have."""
    del norm
    return energy_curves(*given, **named)


PLOTS: dict[str, Plot] = {
    "convergence": Plot(accuracy_table, plot_convergence),
    "error": Plot(error_curves, plot_errors),
    "energy": Plot(_energies, plot_energies),
}
