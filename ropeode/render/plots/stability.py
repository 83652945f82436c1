"""The region of stability of a stepper, with the eigenvalues of a problem in it."""

from __future__ import annotations

import math

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import ArrayLike

from ropeode.render.plots.style import (
    BAND,
    BAND_EDGE,
    STYLE,
    make_room,
    new_figure,
    stepper_style,
)
from ropeode.render.stability_words import limit_words, region_words
from ropeode.render.table_words import problem_words
from ropeode.study import Explanation, check_steps
from ropeode.theory import LinearStability, StabilityRegion
from ropeode.validation import bad_value, check_kind, counted

_HEIGHT = 4.2
# Levels of the factor by which a mode grows in a step.
_LEVELS = (0.25, 0.5, 0.75)
_COARSEST = 4


@matplotlib.rc_context(STYLE)
def plot_stability(explanation: Explanation, steps_per_frame: ArrayLike | None = None) -> Figure:
    """Where a step does not let a mode grow, and where the modes of a problem are.

    Arguments:
        explanation: from `ropeode.explain_stepper`.
        steps_per_frame: the step sizes with which the eigenvalues are drawn, whole numbers, each
            once; by default the four coarsest of the runs, whose eigenvalues lie farthest out.

    Returns:
        A matplotlib figure, 6.5 inches wide: the complex plane of ``z = dt lambda``, a pure
        number. The region of stability is grey, and its edge dark; thin lines are where a mode
        shrinks to 3/4, 1/2 and 1/4 in a step. Each colour is a step size, and each of its marks an
        eigenvalue of the problem at one time of its solution. Those outside of the axes are
        counted in the legend. A mode that grows in the solution itself has a hollow mark.

    Raises:
        InputError: the stepper has no region of stability, or these are no numbers of steps.

    Examples:
        >>> from ropeode import Rope, explain_stepper, plot_stability
        >>> explained = explain_stepper("rk4", Rope(num_nodes=4).problem(frames=3))
        >>> plot_stability(explained).axes[0].get_xlabel()
        'Re z,  z = dt λ'
    """
    if steps_per_frame is not None:
        steps_per_frame = check_steps(steps_per_frame)
    check_kind("explanation", explanation, Explanation, "explain_stepper")
    region, found = explanation.region, explanation.stability
    if region is None:
        why = " ".join(found.notes) or "it has no stability function"
        raise bad_value(
            "explanation",
            explanation.stepper,
            f"a stepper with a stability function ({why.rstrip('.')})",
            "explain another stepper",
        )
    if steps_per_frame is None:
        steps_per_frame = [row.steps_per_frame for row in explanation.tables[0].rows[:_COARSEST]]
    # The longest steps first, which spread the eigenvalues most.
    drawn = sorted(steps_per_frame)
    function = region.function
    figure = new_figure(
        f"Stability of {function.stepper}: {problem_words(found.problem)}",
        limit_words(found.predicted),
        _HEIGHT,
    )
    axes = figure.subplots()
    _draw_region(axes, region)
    handles: list[Patch | Line2D] = [
        Patch(facecolor=BAND, edgecolor="0.25", label=region_words(function))
    ]
    for index, steps in enumerate(drawn):
        handles.append(_draw_modes(axes, found, steps, *stepper_style(index)))
    figure.legend(handles=handles, loc="outside lower center", ncols=2)
    make_room(figure, _HEIGHT, math.ceil(len(handles) / 2))
    return figure


def _draw_region(axes: Axes, region: StabilityRegion) -> None:
    x, y = region.real, region.imaginary
    axes.set(
        xlim=(x[0], x[-1]),
        ylim=(y[0], y[-1]),
        xlabel="Re z,  z = dt λ",
        ylabel="Im z",
        aspect="equal",
    )
    # Where the factor is infinite there is no level to draw.
    radius = np.minimum(region.radius, 1e6)
    axes.contourf(x, y, radius, levels=[0.0, 1.0 + 1e-9], colors=[BAND], zorder=0.5)
    axes.contour(x, y, radius, levels=_LEVELS, colors=[BAND_EDGE], linewidths=0.5, zorder=0.7)
    axes.contour(x, y, radius, levels=[1.0 + 1e-9], colors=["0.25"], linewidths=1.0, zorder=0.8)
    for line in (axes.axhline, axes.axvline):
        line(0.0, color="0.4", linewidth=0.6, zorder=1.0)


def _draw_modes(axes: Axes, found: LinearStability, steps: int, colour: str, marker: str) -> Line2D:
    """The eigenvalues times dt, and what the legend says of them."""
    dt = found.dt(steps)
    z, growing = dt * found.along.eigenvalues.ravel(), found.along.growing.ravel()
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    inside = (left <= z.real) & (z.real <= right) & (low <= z.imag) & (z.imag <= high)
    form = {"linestyle": "none", "marker": marker, "markersize": 3.5, "color": colour}
    for chosen, face in ((growing, "none"), (~growing, colour)):
        some = z[inside & chosen]
        axes.plot(some.real, some.imag, markerfacecolor=face, zorder=2.5, **form)
    label = f"eigenvalues at {counted(steps, 'step')}/frame"
    if outside := int(np.sum(~inside)):
        label += f" ({outside} of {len(z)} outside)"
    return Line2D([], [], label=label, **form)
