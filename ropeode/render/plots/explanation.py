"""The pictures that go with the explanation of a stepper."""

from __future__ import annotations

from ropeode.render.plots.against_time import plot_errors
from ropeode.render.plots.convergence import plot_convergence
from ropeode.render.plots.files import figure_bytes
from ropeode.render.plots.stability import plot_stability
from ropeode.study import Explanation


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
        figures["stability"] = plot_stability(explanation)
    for curves in explanation.against_time:
        if curves.curves:
            figures[f"error-{curves.norm.quantity}"] = plot_errors(curves)
    return {f"{name}.png": figure_bytes(figure, ".png") for name, figure in figures.items()}
