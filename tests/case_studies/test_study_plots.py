"""Pictures of the answers hold the numbers of the studies."""

from __future__ import annotations

import numpy as np
import pytest

from docs.studies.growth import MeasuredGrowth
from docs.studies.plots import plot_growth, plot_rest_times, plot_sweeps
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
