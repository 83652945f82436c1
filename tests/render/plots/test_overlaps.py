"""Lines that coincide share their path, and marks stand side by side."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from ropeode.render.plots.overlaps import moved_right, side_by_side, take_turns


@pytest.fixture
def axes():
    axes = Figure(figsize=(6, 4)).subplots()
    axes.set(xscale="log", yscale="log", xlim=(1e-3, 1), ylim=(1e-6, 1))
    return axes


X = np.geomspace(2e-3, 0.5, 12)


@pytest.mark.parametrize("count", [2, 3, 12])
def test_every_line_on_a_shared_path_shows(axes, count):
    """At each place one line is seen: the first is whole, the others lie on it in turn."""
    lines = [axes.plot(X, X, linewidth=1.5)[0] for _ in range(count)]
    assert take_turns(lines)
    whole, dashed = lines[0], lines[1:]
    assert whole.get_linestyle() == "-"
    assert all(whole.get_zorder() < line.get_zorder() for line in dashed)
    starts = []
    for line in dashed:
        offset, (on, off) = line._dash_pattern
        assert off == pytest.approx((count - 1) * on)
        starts.append(-offset % (on + off) / on)
    # Each in a place of its own, none in that of the line below.
    assert sorted(starts) == pytest.approx(range(1, count))


def test_lines_that_are_apart_stay_whole(axes):
    lines = [axes.plot(X, X * factor)[0] for factor in (1, 2)]
    lines += axes.plot(X, X**3)
    # This one crosses the first, and one that is out of sight coincides with another.
    lines += axes.plot(X, 0.01 / X)
    lines += [axes.plot(X, 1e9 * X)[0] for _ in range(2)]
    assert not take_turns(lines)
    assert {line.get_linestyle() for line in lines} == {"-"}


def test_the_line_that_leaves_the_others_stays_whole(axes):
    leaving = X * np.where(X > 0.05, (X / 0.05) ** 3, 1.0)
    lines = [axes.plot(X, y)[0] for y in (X, leaving, X)]
    assert take_turns(lines)
    assert [line.get_linestyle() for line in lines] == ["--", "-", "--"]


def test_marks_that_would_hide_one_another_stand_side_by_side(axes):
    marks = np.array([(0.1, 0.1), (0.1, 0.1), (0.1, 0.101), (0.1, 1e-4), (0.2, 0.1), (0.3, 0.1)])
    moved = side_by_side(axes, marks)
    assert list(moved[3:]) == [0, 0, 0]
    assert moved[0] == -moved[2] < moved[1] == 0
    # They stay nearer to their own step size than to the next.
    gap = np.diff(axes.transData.transform(marks[[0, 4]])[:, 0])[0] * 72 / axes.figure.dpi
    assert moved[2] < gap / 2
    point = moved_right(axes, 36.0).transform((0.1, 0.1)) - axes.transData.transform((0.1, 0.1))
    assert point == pytest.approx([axes.figure.dpi / 2, 0])
