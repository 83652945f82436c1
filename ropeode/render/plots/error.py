"""Error against time."""

from __future__ import annotations

import matplotlib
from matplotlib.figure import Figure

from ropeode.render.plots.curves import Error, draw_curves
from ropeode.render.plots.labels import with_unit
from ropeode.render.plots.panels import draw_legend, new_panels
from ropeode.render.plots.style import PREDICTED, PREDICTION, STYLE
from ropeode.render.plots.time_axes import draw_horizon
from ropeode.study import ErrorCurves
from ropeode.validation import check_kind

# Times the motion; an error above it is that of a run that has blown up.
_HIGHEST = 10.0


@matplotlib.rc_context(STYLE)
def plot_errors(curves: ErrorCurves) -> Figure:
    """Error against time for each run, with what the reference can resolve.

    Arguments:
        curves: from `ropeode.error_curves`.

    Returns:
        A matplotlib figure, 6.5 inches wide, with a panel for each stepper, or a single one
        where there is one number of steps per frame; time in the problem's unit, errors
        (logarithmic) in that of the norm. docs/howto/plots.md says what each mark means.

    Examples:
        >>> from ropeode import Rope, error_curves, plot_errors
        >>> curves = error_curves(Rope(num_nodes=4).problem(frames=3), ["rk4"], [16, 64])
        >>> plot_errors(curves).axes[0].get_ylabel()
        'error [length units]'
    """
    check_kind("curves", curves, ErrorCurves, "error_curves")
    label = with_unit("error", curves.problem, curves.norm.quantity)
    figure, panels = new_panels(
        curves.problem, curves.curves, "Error", f"Error: {curves.norm.words}", label
    )
    errors = {id(each): Error(each.times, each.values) for each in curves.curves}
    shared = draw_curves(panels, curves.times, curves.bound, errors, _HIGHEST * curves.motion)
    for panel, axes in panels:
        draw_horizon(axes, curves.reference)
        for line in panel.lines:
            if (predicted := line.curve.predicted) is not None:
                # Above the measured one, which it would else hide behind.
                look = {"color": "0.1", "zorder": 3, **PREDICTION}
                axes.plot(curves.times, predicted, label=PREDICTED, **look)
    draw_legend(figure, panels, shared)
    return figure
