"""Error against time."""

from __future__ import annotations

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ropeode.render.plots.labels import with_unit
from ropeode.render.plots.panels import Line, draw_legend, new_panels
from ropeode.render.plots.style import BAND, BAND_EDGE, PREDICTED, PREDICTION, STYLE
from ropeode.render.plots.time_axes import draw_ends, draw_horizon
from ropeode.study.curves import ErrorCurves

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
        (logarithmic) in that of the norm. docs/plots.md says what each mark means.
    """
    label = with_unit("error", curves.problem, curves.norm.quantity)
    figure, panels = new_panels(curves, "Error", f"Error: {curves.norm.words}", label)
    for panel, axes in panels:
        axes.set(yscale="log", ylim=_limits(curves))
        _draw_reference(axes, curves)
        for line in panel.lines:
            _draw_line(axes, line, curves.resolution, curves.times)
    draw_legend(figure, panels)
    return figure


def _limits(curves: ErrorCurves) -> tuple[float, float]:
    """The ends of the error axis: no run that blew up stretches it."""
    highest = _HIGHEST * curves.motion
    stable = [each.values[each.values <= highest] for each in curves.curves]
    numbers = np.concatenate([curves.resolution, *stable])
    low = min(curves.bound[curves.bound > 0], default=1e-16) / 10.0
    return low, 10.0 * float(np.max(numbers[numbers > 0], initial=low))


def _draw_reference(axes: Axes, curves: ErrorCurves) -> None:
    axes.fill_between(
        curves.times, 0.0, curves.bound, color=BAND, linewidth=0, label="reference's bound"
    )
    axes.plot(
        curves.times,
        curves.resolution,
        color=BAND_EDGE,
        linewidth=0.9,
        linestyle="--",
        label="resolution (10 × bound)",
    )
    draw_horizon(axes, curves.reference)


def _draw_line(axes: Axes, line: Line, resolution: np.ndarray, times: np.ndarray) -> None:
    """Solid where errors are resolved, dotted and grey between all others."""
    low, high = axes.get_ylim()
    # What is out of sight is still a number that can be drawn.
    values = np.clip(line.curve.values, low, 10.0 * high)
    resolved = line.curve.values >= resolution[: len(values)]
    if not np.all(resolved):
        axes.plot(
            line.curve.times,
            values,
            color="0.6",
            linestyle=":",
            linewidth=1.0,
            zorder=1.8,
            label="error below the resolution",
        )
    axes.plot(
        line.curve.times,
        np.where(resolved, values, np.nan),
        color=line.colour,
        marker=".",
        markersize=2.5,
        label=line.label,
    )
    draw_ends(axes, line, values)
    if line.curve.predicted is not None:
        # Above the measured one, which it would else hide behind.
        axes.plot(times, line.curve.predicted, color="0.1", label=PREDICTED, zorder=3, **PREDICTION)
