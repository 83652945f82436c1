"""The convergence plot shows each run of the table as the table has it."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.patches import Polygon, Rectangle

from ropeode import plot_convergence
from ropeode.analysis import REASONS, UNRESOLVED, UNSTABLE
from ropeode.render import figure_bytes
from tests.render.plots import drawn
from tests.render.plots.drawn import look

ALL_CASES = ["rope", "diverged", "cut", "one step size", "unsolved", "still"]


# What the legend says of runs that have no place on the axes.
OFF_AXIS, DIVERGED = "unstable, error above this axis", "unstable, diverged"


def legend_of(figure):
    """A stepper's label is its name here, without its order."""
    return {label.partition(": ")[0]: shown for label, shown in drawn.legend_of(figure).items()}


def drawn_points(axes):
    """Everything that has a marker, as (colour, marker, dt, error)."""
    return [
        (*look(line), *point)
        for line in axes.lines
        if line.get_marker() != "None"
        for point in line.get_xydata()
    ]


def expected_point(table, row, legend, top):
    """What docs/howto/plots.md promises for a row."""
    colour, marker = legend[row.stepper]
    found = next(each.order for each in table.orders if each.stepper == row.stepper)
    if row.dt in found.used:
        return (colour, marker, row.dt, row.error_max)
    reason = next(point.reason for point in found.left_out if point.dt == row.dt)
    if row.status != "ok":
        mark = DIVERGED if row.status == "diverged" else reason
        return (colour, legend[mark][1], row.dt, top)
    if reason == UNRESOLVED:
        return (colour, legend[reason][1], row.dt, row.resolution)
    if reason == UNSTABLE and row.error_max > top:
        return (colour, legend[OFF_AXIS][1], row.dt, top)
    return (colour, legend[reason][1], row.dt, row.error_max)


def by_place(points):
    return sorted(points, key=lambda point: (point[0], *point[2:]))


@pytest.mark.parametrize("case", ALL_CASES)
def test_each_run_once_with_its_mark(case, study):
    table = study("convergence", case)
    figure = plot_convergence(table)
    (axes,) = figure.axes
    legend, top = legend_of(figure), axes.get_ylim()[1]
    expected = [expected_point(table, row, legend, top) for row in table.rows]
    if case == "still":  # Zero is on no logarithmic axis: it stands at the edge.
        expected = [(*point[:3], max(point[3], axes.get_ylim()[0])) for point in expected]
    assert by_place(drawn_points(axes)) == by_place(expected)


def test_every_reason_has_a_mark_of_its_own(study):
    """An unstable run seldom stays near the stable ones."""
    legend = {}
    for case in ALL_CASES:
        legend |= legend_of(plot_convergence(study("convergence", case)))
    marks = {reason: legend[reason][1] for reason in {*REASONS, OFF_AXIS, DIVERGED} - {UNSTABLE}}
    assert len(set(marks.values())) == len(marks)
    used = {legend[each][1] for each in ("stormer-verlet", "rk4", "explicit-euler")}
    assert not used & set(marks.values())


def test_many_steppers_all_look_different(study):
    table = study("convergence", "one step size")
    names = [f"stepper {i}" for i in range(56)]
    many = dataclasses.replace(
        table,
        rows=tuple(dataclasses.replace(table.rows[0], stepper=name) for name in names),
        orders=tuple(dataclasses.replace(table.orders[0], stepper=name) for name in names),
    )
    axes = Figure().subplots()
    plot_convergence(many, ax=axes)
    legend = axes.get_legend()
    looks = {
        look(handle)
        for handle, text in zip(legend.legend_handles, legend.get_texts(), strict=True)
        if text.get_text().startswith("stepper ")
    }
    assert len(looks) == len(names)


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
        figure = plot_convergence(table)
        (axes,), legend = figure.axes, legend_of(figure)
        lines = {
            to_hex(line.get_color()).upper(): line.get_xydata()
            for line in axes.lines
            if line.get_marker() == "None" and len(line.get_xydata()) > 2
        }
        for each in table.orders:
            colour = legend[each.stepper][0]
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
