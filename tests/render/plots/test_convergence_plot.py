"""The convergence plot shows each run of the table as the table has it."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.patches import Polygon, Rectangle

from ropeode.analysis import REASONS, UNRESOLVED, UNSTABLE
from ropeode.render.plots.convergence import plot_convergence
from ropeode.render.plots.files import figure_bytes
from ropeode.render.plots.point_markers import DIVERGED, MARKS, OFF_AXIS
from ropeode.render.plots.style import stepper_style

ALL_CASES = ["rope", "diverged", "cut", "one step size", "unsolved", "still"]


def drawn_points(axes):
    """Everything that has a marker, as (colour, marker, dt, error)."""
    return [
        (to_hex(line.get_color()).upper(), line.get_marker(), *point)
        for line in axes.lines
        if line.get_marker() != "None"
        for point in line.get_xydata()
    ]


def expected_point(table, row, index, top):
    """What docs/howto/plots.md promises for a row."""
    colour, marker = stepper_style(index)
    found = table.orders[index].order
    if row.dt in found.used:
        return (colour, marker, row.dt, row.error_max)
    reason = next(point.reason for point in found.left_out if point.dt == row.dt)
    if row.status != "ok":
        mark = DIVERGED if row.status == "diverged" else reason
        return (colour, MARKS[mark]["marker"], row.dt, top)
    if reason == UNRESOLVED:
        return (colour, MARKS[reason]["marker"], row.dt, row.resolution)
    if reason == UNSTABLE and row.error_max > top:
        return (colour, MARKS[OFF_AXIS]["marker"], row.dt, top)
    return (colour, MARKS[reason]["marker"], row.dt, row.error_max)


def by_place(points):
    return sorted(points, key=lambda point: (point[0], *point[2:]))


@pytest.mark.parametrize("case", ALL_CASES)
def test_each_run_once_with_its_mark(case, study):
    table = study("convergence", case)
    (axes,) = plot_convergence(table).axes
    top = axes.get_ylim()[1]
    steppers = [each.stepper for each in table.orders]
    expected = [expected_point(table, row, steppers.index(row.stepper), top) for row in table.rows]
    if case == "still":  # Zero is on no logarithmic axis: it stands at the edge.
        expected = [(*point[:3], max(point[3], axes.get_ylim()[0])) for point in expected]
    assert by_place(drawn_points(axes)) == by_place(expected)


def test_the_cases_hold_every_mark(study):
    shown = {
        point[1]
        for case in ALL_CASES
        for point in drawn_points(plot_convergence(study("convergence", case)).axes[0])
    }
    for mark, form in MARKS.items():
        # An unstable run seldom stays near the stable ones.
        assert form["marker"] in shown or mark == UNSTABLE


def test_every_reason_has_a_mark_of_its_own():
    assert {*REASONS, OFF_AXIS, DIVERGED} == set(MARKS)
    assert len({str(form["marker"]) for form in MARKS.values()}) == len(MARKS)
    assert not {stepper_style(i)[1] for i in range(56)} & {str(m["marker"]) for m in MARKS.values()}
    assert len({stepper_style(i) for i in range(56)}) == 56


@pytest.mark.parametrize("case", ALL_CASES)
def test_band_ends_at_the_resolution(case, study):
    table = study("convergence", case)
    figure = plot_convergence(table)
    (axes,) = figure.axes
    (band,) = [patch for patch in axes.patches if isinstance(patch, Rectangle)]
    assert band.get_y() == 0
    assert band.get_y() + band.get_height() == table.rows[0].resolution
    labels = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
    assert any(f"unresolved: below {table.rows[0].resolution:.1e}" in label for label in labels)


@pytest.mark.parametrize("case", ALL_CASES)
def test_axis_is_not_stretched(case, study):
    """By an error that is no part of the convergence, or by a resolution far below all."""
    table = study("convergence", case)
    low, high = plot_convergence(table).axes[0].get_ylim()
    used = [
        row.error_max
        for row in table.rows
        for each in table.orders
        if each.stepper == row.stepper and row.dt in each.order.used
    ]
    for error in used:
        assert low < error < high
    assert high / low < 1e20


def test_lines_have_the_observed_slope(study):
    for case in ALL_CASES:
        table = study("convergence", case)
        (axes,) = plot_convergence(table).axes
        lines = {
            to_hex(line.get_color()).upper(): line.get_xydata()
            for line in axes.lines
            if line.get_marker() == "None" and len(line.get_xydata()) > 2
        }
        for index, each in enumerate(table.orders):
            colour = stepper_style(index)[0]
            assert (colour in lines) == (each.order.observed is not None)
            if colour in lines:
                dt, error = lines[colour].T
                assert (dt[0], dt[-1]) == pytest.approx((each.order.used[-1], each.order.used[0]))
                slope = np.log(error[-1] / error[0]) / np.log(dt[-1] / dt[0])
                assert slope == pytest.approx(each.order.observed, rel=1e-9)
                # The line is the fit: what is left of the points has no mean.
                errors = {
                    row.dt: row.error_max for row in table.rows if row.stepper == each.stepper
                }
                left = [np.log(errors[d]) - np.interp(np.log(d), np.log(dt), np.log(error))
                        for d in each.order.used]  # fmt: skip
                assert np.mean(left) == pytest.approx(0, abs=1e-9)


def test_triangles_have_the_slopes_of_the_orders(study):
    table = study("convergence", "rope")
    (axes,) = plot_convergence(table).axes
    triangles = [patch for patch in axes.patches if isinstance(patch, Polygon)]
    to_data = axes.transAxes + axes.transData.inverted()
    slopes = []
    for triangle in triangles:
        (x0, y0), _, (x1, y1) = np.log(to_data.transform(triangle.get_xy()[:3]))
        slopes.append((y1 - y0) / (x1 - x0))
    orders = {round(each.order.observed) for each in table.orders if each.order.observed}
    assert slopes == pytest.approx(sorted(orders), rel=1e-6)
    labels = [text.get_text() for text in axes.texts]
    for order in orders:
        assert str(order) in labels


def test_legend_has_the_orders_and_the_reasons(study):
    for case in ALL_CASES:
        table = study("convergence", case)
        words = [
            text.get_text()
            for legend in plot_convergence(table).legends
            for text in legend.get_texts()
        ]
        for each in table.orders:
            (label,) = [word for word in words if word.startswith(f"{each.stepper}: ")]
            if each.order.observed is None:
                assert "undetermined" in label
            else:
                low, high = each.order.ci95
                assert f"{each.order.observed:.3f} [{low:.3f}, {high:.3f}]" in label
            for point in each.order.left_out:
                assert any(word.startswith(point.reason) for word in words)


def test_it_draws_in_axes_of_the_users(study):
    table = study("convergence", "rope")
    figure = Figure(figsize=(12, 4), layout="constrained")
    left, right = figure.subplots(1, 2)
    assert plot_convergence(table, ax=right) is figure
    (own,) = plot_convergence(table).axes
    assert drawn_points(right) == drawn_points(own)
    assert not left.lines
    texts = [text.get_text() for text in right.get_legend().get_texts()]
    assert all(any(each.stepper in text for text in texts) for each in table.orders)
    assert table.problem.name in right.get_title()
    figure_bytes(figure, ".png")
