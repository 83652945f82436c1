"""Pictures of the answers hold the numbers of the studies."""

from __future__ import annotations

import numpy as np
import pytest

from docs.studies.growth import MeasuredGrowth
from docs.studies.plots import plot_besides, plot_growth, plot_rest_times, plot_sweeps
from docs.studies.rest_time import RestTime

pytestmark = pytest.mark.slow


def has_line(axes, x, y) -> bool:
    return any(
        np.array_equal(line.get_xdata(), x) and np.array_equal(line.get_ydata(), y)
        for line in axes.get_lines()
    )


def labelled(figure) -> bool:
    return all(axes.get_xlabel() and axes.get_ylabel() for axes in figure.axes)


def test_sweeps(study):
    figure = plot_sweeps(study)
    errors, lengths = figure.axes
    for each in study.swept:
        assert has_line(errors, each.dts, each.errors)
        assert has_line(lengths, each.dts, each.violations)
    assert labelled(figure)


def test_rest_times():
    found = [
        RestTime("constraint", "per-step", 64, 0.5, 30),
        RestTime("constraint", "per-step", 128, 1.0, None),
        RestTime("force", "lagged", 64, 0.5, 28),
    ]
    figure = plot_rest_times(found)
    frames, products = figure.axes
    assert has_line(frames, [64], [30])
    assert has_line(products, [64], [15.0])
    assert has_line(frames, [64], [28])
    assert labelled(figure)


def test_growth():
    scan = [MeasuredGrowth("rk4", 8, 0.3, 0.31), MeasuredGrowth("rk4", 16, -0.2, -0.21)]
    figure = plot_growth(scan)
    assert has_line(figure.axes[0], [8, 16], [0.3, -0.2])
    assert has_line(figure.axes[0], [8, 16], [0.31, -0.21])
    assert labelled(figure)


def test_besides():
    """Every case of a peer has a line and a point of its own, at the height of the peer."""
    panels = {
        "one rope": {"C++": {"16 nodes": [(0.9, 0.8, 1.1)], "256 nodes": [(1.5, 1.4, 1.6)]}},
        "many": {"NumPy": {"64 ropes": [(20.0, 18.0, 24.0), (30.0, 28.0, 32.0)]}},
    }
    figure = plot_besides(panels)
    for axes, ratios in zip(figure.axes, ([0.9, 1.5], [20.0, 30.0]), strict=True):
        points = [
            line for line in axes.lines if line.get_marker() in "os" and len(line.get_xdata())
        ]
        assert [line.get_xdata()[0] for line in points] == ratios
        heights = [line.get_ydata()[0] for line in points]
        assert -0.4 < heights[0] < heights[1] < 0.4
    assert has_line(figure.axes[0], [0.8, 1.1], [-0.1, -0.1])
    assert figure.axes[0].get_yticklabels()[0].get_text() == "C++"
    assert figure.axes[0].get_legend() is not None
    assert figure.axes[1].get_legend() is None
    assert figure.axes[1].get_xlabel()
