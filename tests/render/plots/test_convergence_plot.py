"""What no file of `test_plot_pictures.py` shows of the convergence plot."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from ropeode import plot_convergence
from ropeode.render import figure_bytes
from tests.render.made_up import table_of
from tests.render.plots.drawn import look
from tests.render.plots.studies import study


def test_triangles_have_the_slopes_of_the_orders():
    (axes,) = plot_convergence(study("every-reason")).axes
    to_data = axes.transAxes + axes.transData.inverted()
    slopes = []
    for triangle in (patch for patch in axes.patches if isinstance(patch, Polygon)):
        (x0, y0), _, (x1, y1) = np.log(to_data.transform(triangle.get_xy()[:3]))
        slopes.append((y1 - y0) / (x1 - x0))
    assert slopes == pytest.approx([2, 4], rel=1e-6)


def test_many_steppers_all_look_different():
    names = [f"stepper {i}" for i in range(56)]
    found = study("no-order")
    rows, orders = (
        [dataclasses.replace(each[0], stepper=name) for name in names]
        for each in (found.rows, found.orders)
    )
    axes = Figure().subplots()
    plot_convergence(table_of(rows, orders), ax=axes)
    legend = axes.get_legend()
    looks = {
        look(handle)
        for handle, text in zip(legend.legend_handles, legend.get_texts(), strict=True)
        if text.get_text().startswith("stepper ")
    }
    assert len(looks) == len(names)


def test_it_draws_in_axes_of_the_users():
    table = study("every-reason")
    figure = Figure(figsize=(12, 4), layout="constrained")
    left, right = figure.subplots(1, 2)
    assert plot_convergence(table, ax=right) is figure
    (own,) = plot_convergence(table).axes
    drawn = [[(look(line), line.get_xydata().tolist()) for line in ax.lines] for ax in (own, right)]
    assert drawn[0] == drawn[1]
    assert not left.lines
    texts = [text.get_text() for text in right.get_legend().get_texts()]
    assert any(text.startswith("rk4: ") for text in texts)
    assert table.problem.name in right.get_title()
    figure_bytes(figure, ".png")
