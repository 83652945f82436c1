"""Errors and energies against time: each line is the run's numbers, and ends where it does."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.colors import to_hex

from ropeode.render.plots.energy import plot_energies
from ropeode.render.plots.error import plot_errors
from ropeode.render.plots.panels import panels_of

ALL_CASES = ["rope", "diverged", "cut", "one step size", "still"]
DRAW = {"error": plot_errors, "energy": plot_energies}


def panels_with_axes(kind, data):
    figure = DRAW[kind](data)
    panels = panels_of(data.curves)
    assert len(figure.axes) == len(panels)
    return list(zip(panels, figure.axes, strict=True))


def line_of(axes, line):
    """The drawn line of a run: by its colour, without the single marks."""
    (found,) = [
        each
        for each in axes.lines
        if to_hex(each.get_color()) == line.colour.lower() and each.get_linestyle() == "-"
    ]
    return found


def labelled(axes, label):
    return [each for each in axes.lines if each.get_label() == label]


@pytest.mark.parametrize("kind", DRAW)
def test_every_curve_has_one_line_in_the_panel_of_its_stepper(kind, study):
    for case in ALL_CASES:
        data = study(kind, case)
        drawn = []
        for panel, axes in panels_with_axes(kind, data):
            assert axes.get_title(loc="left").replace("\n", "") == panel.title
            assert len({line.colour for line in panel.lines}) == len(panel.lines)
            for line in panel.lines:
                assert not panel.title or line.curve.stepper == panel.title
                assert str(line.curve.steps_per_frame) in line.label
                assert panel.title or line.curve.stepper in line.label
                drawn.append(line.curve)
        assert set(map(id, drawn)) == set(map(id, data.curves))
        steps = {curve.steps_per_frame for curve in data.curves}
        steppers = {curve.stepper for curve in data.curves}
        assert len(panels_of(data.curves)) == (1 if len(steps) == 1 else len(steppers))


@pytest.mark.parametrize("case", ALL_CASES)
def test_errors_are_solid_where_they_are_resolved(case, study):
    data = study("error", case)
    for panel, axes in panels_with_axes("error", data):
        low, high = axes.get_ylim()
        for line in panel.lines:
            times, values = line_of(axes, line).get_data()
            assert np.array_equal(times, line.curve.times)
            known = line.curve.values >= data.resolution[: len(times)]
            assert np.array_equal(np.isfinite(values), known)
            inside = known & (line.curve.values > low) & (line.curve.values < high)
            assert np.array_equal(values[inside], line.curve.values[inside])
        dotted = [each for each in axes.lines if each.get_linestyle() == ":"]
        some_unresolved = [
            line
            for line in panel.lines
            if np.any(line.curve.values < data.resolution[: len(line.curve.values)])
        ]
        assert len(dotted) == len(some_unresolved)


@pytest.mark.parametrize("case", ALL_CASES)
def test_energies_are_the_runs_and_the_references(case, study):
    data = study("energy", case)
    for panel, axes in panels_with_axes("energy", data):
        low, high = axes.get_ylim()
        (reference,) = labelled(axes, "reference")
        assert np.array_equal(reference.get_data(), (data.times, data.values))
        assert low < np.min(data.values)
        assert high > np.max(data.values)
        for line in panel.lines:
            times, values = line_of(axes, line).get_data()
            inside = (line.curve.values > low) & (line.curve.values < high)
            assert np.array_equal(times, line.curve.times)
            assert np.array_equal(values[inside], line.curve.values[inside])


@pytest.mark.parametrize("case", ALL_CASES)
@pytest.mark.parametrize("kind", DRAW)
def test_lines_end_with_a_mark_where_the_run_left(kind, case, study):
    data = study(kind, case)
    for panel, axes in panels_with_axes(kind, data):
        low, high = axes.get_ylim()
        marks = {
            (to_hex(each.get_color()), each.get_marker(), *point)
            for each in axes.lines
            if each.get_marker() in "X^v"
            for point in each.get_xydata()
        }
        expected = set()
        for line in panel.lines:
            curve, colour = line.curve, line.colour.lower()
            above, below = curve.values > high, curve.values < low
            if kind == "error":
                below[:] = False  # A small error has not left; it is unresolved.
            outside = np.flatnonzero(above | below)
            if len(outside):
                first = outside[0]
                edge = ("^", curve.times[first], high) if above[first] else None
                expected.add((colour, *(edge or ("v", curve.times[first], low))))
            if curve.diverged_at is not None:
                expected.add((colour, "X", curve.diverged_at, high))
                assert not len(curve.times) or curve.times[-1] < curve.diverged_at
        assert marks == expected
    if case == "diverged":
        assert any(curve.diverged_at is not None for curve in data.curves)


@pytest.mark.parametrize("case", ALL_CASES)
def test_band_and_resolution(case, study):
    data = study("error", case)
    for _, axes in panels_with_axes("error", data):
        (band,) = axes.collections
        assert band.get_label() == "reference's bound"
        corners = {tuple(corner) for corner in band.get_paths()[0].vertices}
        assert set(zip(data.times, data.bound, strict=True)) <= corners
        (line,) = labelled(axes, "resolution (10 × bound)")
        assert np.array_equal(line.get_data(), (data.times, 10 * data.bound))


@pytest.mark.parametrize("case", ALL_CASES)
@pytest.mark.parametrize("kind", DRAW)
def test_horizon_is_a_line_with_its_reason(kind, case, study):
    data = study(kind, case)
    reference = data.reference
    assert (reference.horizon is not None) == (case == "cut")
    for _, axes in panels_with_axes(kind, data):
        upright = [line for line in axes.lines if line.get_linestyle() == "-."]
        assert len(upright) == (reference.horizon is not None)
        for line in upright:
            assert list(line.get_xdata()) == [reference.horizon] * 2
            assert reference.certificate.horizon_reason in line.get_label()
            assert f"t = {reference.horizon:g}" in line.get_label()


def test_one_that_blew_up_does_not_stretch_the_axes(study):
    errors, energies = study("error", "rope"), study("energy", "rope")
    assert max(np.max(curve.values) for curve in errors.curves) > 100 * errors.motion
    for axes in plot_errors(errors).axes:
        assert axes.get_ylim()[1] <= 100 * errors.motion
    size = np.max(np.abs(energies.values))
    for axes in plot_energies(energies).axes:
        assert np.ptp(axes.get_ylim()) < size
