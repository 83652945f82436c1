"""Errors and energies against time: each line is the run's numbers, and ends where it does."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.lines import Line2D

from ropeode import plot_energies, plot_errors
from ropeode.study import Curve

ALL_CASES = ["rope", "diverged", "cut", "one step size", "still"]
DRAW = {"error": plot_errors, "energy": plot_energies}


class Drawn(NamedTuple):
    """A curve with the line that stands for it; the single marks on the line have no label."""

    curve: Curve
    line: Line2D
    label: str
    colour: str


class Panel(NamedTuple):
    title: str
    lines: list[Drawn]


def panels_with_axes(kind, data):
    """One panel where each stepper has one curve; else a panel for each stepper, by its title."""
    figure = DRAW[kind](data)
    steppers = list(dict.fromkeys(curve.stepper for curve in data.curves))
    alone = len(steppers) == len(data.curves)
    found = []
    for title, axes in zip([""] if alone else steppers, figure.axes, strict=True):
        lines = []
        for curve in data.curves:
            if title in ("", curve.stepper):
                label = f"{curve.stepper}, {curve.label}" if alone else curve.label
                (line,) = labelled(axes, label)
                lines.append(Drawn(curve, line, label, to_hex(line.get_color())))
        found.append((Panel(title, lines), axes))
    return found


def known_errors(kind, data, curve):
    """Times and errors as they are to be drawn, without the first sample."""
    if kind == "error":
        return curve.times, curve.values
    errors = data.errors(curve)
    return curve.times[: len(errors)][1:], errors[1:]


def labelled(axes, label):
    return [each for each in axes.lines if each.get_label() == label]


@pytest.mark.parametrize("kind", DRAW)
def test_every_curve_has_one_line_in_the_panel_of_its_stepper(kind, study):
    for case in ALL_CASES:
        data = study(kind, case)
        drawn = []
        for panel, axes in panels_with_axes(kind, data):
            assert axes.get_title(loc="left").replace("\n", "") == panel.title
            looks = {(each.colour, each.line.get_marker()) for each in panel.lines}
            assert len(looks) == len(panel.lines)
            for each in panel.lines:
                assert str(each.curve.steps_per_frame) in each.label
                drawn.append(each)
        assert sorted(id(each.curve) for each in drawn) == sorted(map(id, data.curves))
        # The same colour means the same in all panels.
        assert len({(each.label, each.colour) for each in drawn}) == len(
            {each.label for each in drawn}
        )


@pytest.mark.parametrize("case", ALL_CASES)
@pytest.mark.parametrize("kind", DRAW)
def test_errors_are_coloured_where_they_are_resolved(kind, case, study):
    data = study(kind, case)
    for panel, axes in panels_with_axes(kind, data):
        low, high = axes.get_ylim()
        unresolved = 0
        for line in panel.lines:
            times, values = line.line.get_data()
            at, errors = known_errors(kind, data, line.curve)
            assert np.array_equal(times, at)
            start = 0 if kind == "error" else 1
            resolution = data.resolution[start : start + len(at)]
            known = np.abs(errors) >= resolution
            assert np.array_equal(np.isfinite(values), known)
            inside = known & (np.abs(errors) > low) & (np.abs(errors) < high)
            assert np.array_equal(values[inside], np.abs(errors)[inside])
            unresolved += not np.all(known)
        dotted = [each for each in axes.lines if each.get_linestyle() == ":"]
        assert len(dotted) == unresolved


@pytest.mark.parametrize("case", ALL_CASES)
def test_marks_are_hollow_where_energy_is_missing(case, study):
    data = study("energy", case)
    for panel, axes in panels_with_axes("energy", data):
        for line in panel.lines:
            at, errors = known_errors("energy", data, line.curve)
            signs = dict(zip(at, errors, strict=True))
            for each in axes.lines:
                if each.get_marker() == line.line.get_marker() and each.get_linestyle() == "None":
                    if to_hex(each.get_color()) != line.colour:
                        continue
                    for time, size in each.get_xydata():
                        if np.isfinite(size) and size < axes.get_ylim()[1]:
                            hollow = each.get_markerfacecolor() == "white"
                            assert hollow == (signs[time] < 0)


@pytest.mark.parametrize("case", ALL_CASES)
@pytest.mark.parametrize("kind", DRAW)
def test_lines_end_with_a_mark_where_the_run_left(kind, case, study):
    data = study(kind, case)
    for panel, axes in panels_with_axes(kind, data):
        _, high = axes.get_ylim()
        marks = {
            (to_hex(each.get_color()), each.get_marker(), *point)
            for each in axes.lines
            if each.get_marker() in ("X", "^") and each.get_markersize() > 5
            for point in each.get_xydata()
        }
        expected = set()
        for line in panel.lines:
            curve, colour = line.curve, line.colour
            times, errors = known_errors(kind, data, curve)
            if len(above := np.flatnonzero(np.abs(errors) > high)):
                expected.add((colour, "^", times[above[0]], high))
            if curve.diverged_at is not None:
                expected.add((colour, "X", curve.diverged_at, high))
                assert not len(curve.times) or curve.times[-1] < curve.diverged_at
        assert marks == expected
    if case == "diverged":
        assert any(curve.diverged_at is not None for curve in data.curves)


@pytest.mark.parametrize("case", ALL_CASES)
@pytest.mark.parametrize("kind", DRAW)
def test_band_and_resolution(kind, case, study):
    data = study(kind, case)
    known = slice(0 if kind == "error" else 1, None)
    times, bound = data.times[known], data.bound[known]
    for _, axes in panels_with_axes(kind, data):
        (band,) = axes.collections
        assert band.get_label() == "estimated bound"
        corners = {tuple(corner) for corner in band.get_paths()[0].vertices}
        assert set(zip(times, bound, strict=True)) <= corners
        (line,) = labelled(axes, "resolution (10 × bound)")
        assert np.array_equal(line.get_data(), (times, 10 * bound))


@pytest.mark.parametrize("case", ALL_CASES)
@pytest.mark.parametrize("kind", DRAW)
def test_horizon_is_a_line_with_its_reason(kind, case, study):
    """The energy of an undamped rope is known beyond the horizon."""
    data = study(kind, case)
    reference = data.reference
    if kind == "energy" and data.conserved:
        for _, axes in panels_with_axes(kind, data):
            assert not [line for line in axes.lines if line.get_linestyle() == "-."]
        return
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
    for axes in plot_energies(energies).axes:
        assert axes.get_ylim()[1] <= 10 * np.max(np.abs(energies.values))
