"""The types of plots, by name, and the pictures that go with an explanation."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from matplotlib.figure import Figure

from ropeode.checking import trajectory_energy_curves, trajectory_error_curves, trajectory_errors
from ropeode.render.plots.against_time import plot_energies, plot_errors
from ropeode.render.plots.convergence import plot_convergence
from ropeode.render.plots.style import figure_bytes
from ropeode.study import IN_TIME, Explanation, Predict, energy_curves, error_curves
from ropeode.study.accuracy_table import accuracy_table


class Plot(NamedTuple):
    """A type of plot.

    Fields:
        study: called like `ropeode.accuracy_table`.
        of_trajectories: called with files, their problem and step sizes, and the same options.
        draw: makes a figure of what either of them returns.
    """

    study: Callable[..., Any]
    of_trajectories: Callable[..., Any]
    draw: Callable[[Any], Figure]


def _without_norm(study: Callable[..., Any]) -> Callable[..., Any]:
    """An energy is measured in no norm, which a spec may still have."""

    def call(*arguments: Any, norm: str | None, **options: Any) -> Any:
        del norm
        return study(*arguments, **options)

    return call


def _with_theory(study: Callable[..., Any], predict: Predict) -> Callable[..., Any]:
    """Errors of steppers that somebody named are predicted too; of all defaults it takes long."""

    def call(problem: Any, steppers: Any, **options: Any) -> Any:
        return study(problem, steppers, predict=steppers is not None and predict, **options)

    return call


PLOTS: dict[str, Plot] = {
    "convergence": Plot(_with_theory(accuracy_table, IN_TIME), trajectory_errors, plot_convergence),
    "error": Plot(_with_theory(error_curves, True), trajectory_error_curves, plot_errors),
    "energy": Plot(
        _without_norm(energy_curves), _without_norm(trajectory_energy_curves), plot_energies
    ),
}


def explanation_pictures(explanation: Explanation) -> dict[str, bytes]:
    """Errors against step size and against time, measured and predicted; the region of stability.

    Arguments:
        explanation: from `ropeode.explain_stepper`.

    Returns:
        The contents of PNG files, by file name.
    """
    figures = {
        f"convergence-{table.norm.quantity}": plot_convergence(table)
        for table in explanation.tables
    }
    if explanation.region is not None:
        # Not above: it imports theory, which other pictures do not need.
        from ropeode.render.plots.stability import plot_stability

        figures["stability"] = plot_stability(explanation)
    for curves in explanation.against_time:
        if curves.curves:
            figures[f"error-{curves.norm.quantity}"] = plot_errors(curves)
    return {f"{name}.png": figure_bytes(figure, ".png") for name, figure in figures.items()}
