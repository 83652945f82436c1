"""A work-precision study in every format, and its picture."""

from __future__ import annotations

import dataclasses
import re
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.text import Text

from ropeode import Problem, plot_work_precision, work_precision
from ropeode.errors import InputError
from ropeode.problems import PROBLEMS
from ropeode.render import format_work_precision
from ropeode.study import COSTS, INFINITE
from tests.exact_reference import exact_reference
from tests.quartic import HOSTILE
from tests.render.plots.drawn import legend_of, look
from tests.render.plots.legible import assert_legible


def cubic(t, y, args):
    return -100 * y**3


class Own:
    """A solver whose error is known; it fails once, and diverges once."""

    __name__ = HOSTILE

    def __call__(self, problem, rtol):
        truth = 1.0 / np.sqrt(1.0 + 200.0 * problem.ts[:, None])
        if rtol == 1e-4:
            raise ValueError(HOSTILE)
        states = truth + rtol * (problem.ts > 0.0)[:, None]
        if rtol == 1e-2:
            states[2:] = np.inf
        return states, round(1e2 / rtol)


@pytest.fixture(scope="module")
def study():
    """Certified, unresolved, unstable, diverged and failed runs, and a hostile name."""
    problem = Problem(cubic, [1.0], np.arange(4.0), name=HOSTILE)
    truth = exact_reference(problem, 1.0 / np.sqrt(1.0 + 200.0 * problem.ts[:, None]))
    return work_precision(
        truth,
        ["explicit-euler", "rk4", "scipy:DOP853", Own()],
        steps_per_frame=[3, 700, 2100],
        rtol=[1e-2, 1e-4, 1e-6, 3e-8, 1e-13],
        rounds=2,
    )


def test_the_study_has_all_that_one_can_have(study):
    own = [row for row in study.rows if row.method == HOSTILE]
    assert [row.status for row in own] == ["diverged", "failed", "ok", "ok", "ok"]
    assert [row.error_max for row in own][2:4] == [pytest.approx(1e-6), pytest.approx(3e-8)]
    assert {"diverged", "unstable"} & {row.status for row in study.rows if row.effort == 3}


def points_of(axes):
    """The mark of each run, in the order of the study."""
    return [
        line for line in axes.lines if line.get_linestyle() == "None" and len(line.get_xdata()) == 1
    ]


def hover_words(study, cost):
    """What the points of a picture say where the pointer rests, as a browser reads the page."""
    page = format_work_precision(study, "html")
    pictures = re.findall(r"<svg.*?</svg>", page, re.DOTALL)
    root = ElementTree.fromstring(pictures[COSTS.index(cost)])
    space = "{http://www.w3.org/2000/svg}"
    titles = [each.find(f"{space}title") for each in root.iter(f"{space}g")]
    return [title.text or "" for title in titles if title is not None]


@pytest.mark.parametrize("cost", COSTS)
def test_the_picture_draws_each_run_where_it_is(study, cost):
    figure = plot_work_precision(study, cost)
    (axes,) = figure.axes
    legend, (low, high) = legend_of(figure), axes.get_ylim()
    first, last = axes.get_xlim()
    paid = [row for row in study.rows if getattr(row, cost) is not None]
    for row, line in zip(paid, points_of(axes), strict=True):
        ((x, y),) = line.get_xydata()
        assert first < x < last
        assert x == getattr(row, cost)
        colour, marker = legend[f"{row.method} ({row.family})"]
        if row.status != "ok":
            marker, error = legend["unstable, diverged or unsolved, at the upper edge"][1], high
        elif row.error_max is None:
            marker, error = legend["unresolved"][1], study.resolution
        else:
            error = row.error_max
            assert low < error < high
        assert (*look(line), y) == (colour, marker, error)
    (front,) = [line for line in axes.lines if line.get_gid() == "front"]
    expected = [(getattr(row, cost), row.error_max) for row in study.front(cost)]
    np.testing.assert_allclose(front.get_xydata(), np.reshape(expected, (-1, 2)))
    assert axes.get_xscale() == axes.get_yscale() == "log"


def test_families_have_colours_and_methods_markers(study):
    figure = plot_work_precision(study, "rhs_evaluations")
    legend = legend_of(figure)
    looks = [legend[f"{method} ({family})"] for method, family in study.methods.items()]
    assert len({marker for _, marker in looks}) == len(looks)
    families = set(study.methods.values())
    assert len({colour for colour, _ in looks}) == len(families) < len(looks)
    rk4, euler = (
        legend[f"{method} ({study.methods[method]})"] for method in ("rk4", "explicit-euler")
    )
    assert rk4[0] == euler[0]


def test_the_picture_is_legible(study):
    """Error bars and the front are lines of their own, which may lie on others."""
    assert_legible(plot_work_precision(study, "rhs_evaluations"), [])


def test_efforts_stand_beside_the_first_and_the_last_certified_run(study):
    (axes,) = plot_work_precision(study, "rhs_evaluations").axes
    shown = {text.get_text() for text in axes.texts}
    assert shown
    certified = {row.effort for row in study.rows if row.status == "ok" and row.error_max}
    assert {float(text) for text in shown} <= certified


def test_points_say_their_values(study):
    said = hover_words(study, "steps")
    paid = [row for row in study.rows if row.steps is not None]
    for row, words in zip(paid, said, strict=True):
        assert words.startswith(f"{row.method}, ")
        assert f"steps: {row.steps}" in words
    words = next(text for text in said if text.startswith("rk4, 700 steps/frame"))
    row = next(row for row in study.rows if row.method == "rk4" and row.effort == 700)
    assert f"max error: {row.error_max:.3e}" in words
    assert f"evaluations: {row.rhs_evaluations}" in words


@pytest.fixture(scope="module")
def swing():
    """Of the oscillator, with an energy; the errors of its methods are made up."""
    problem = PROBLEMS["oscillator"](damping=0.0, frames=4)
    return exact_reference(problem, problem.exact(problem.ts))


def made_up(truth, name, runs):
    """A method with these errors and evaluations, from loose to tight; None fails."""
    known = dict(zip((1e-2, 1e-3, 1e-4, 1e-5), runs, strict=False))

    def solve(problem, rtol):
        error, calls = known[rtol]
        return truth.states + error * (problem.ts > 0.0)[:, None, None, None], calls

    solve.__name__ = name
    return solve


def test_lines_join_neighbours_only(swing):
    """Nothing is interpolated over a run that failed, so nothing is drawn there."""
    run = made_up(swing, "gap", [(1e-1, 10), None, (1e-3, 1000), (1e-4, 10000)])
    found = work_precision(swing, run, rtol=[1e-2, 1e-3, 1e-4, 1e-5], rounds=1)
    assert [row.status for row in found.rows] == ["ok", "failed", "ok", "ok"]
    (axes,) = plot_work_precision(found, "rhs_evaluations").axes
    drawn = [line.get_xdata() for line in axes.lines if line.get_gid() is None]
    spans = [(min(x), max(x)) for x in drawn if len(x) > 1]
    assert (1000, 10000) in spans
    assert not any(low < 1000 and 10 < high <= 10000 for low, high in spans)


@pytest.mark.parametrize("calls", [[7], [30, 70], [100], [90, 2000]])
def test_the_cost_axis_says_two_numbers(calls, swing):
    run = made_up(swing, "some", [(1e-3 / each, each) for each in calls])
    found = work_precision(swing, run, rtol=[1e-2, 1e-3][: len(calls)], rounds=1)
    figure = plot_work_precision(found, "rhs_evaluations")
    figure.draw_without_rendering()
    (axes,) = figure.axes
    low, high = axes.get_xlim()
    labels = axes.xaxis.get_ticklabels()
    shown = [x for x, label in zip(axes.get_xticks(), labels, strict=True) if label.get_text()]
    assert sum(low <= x <= high for x in shown) >= 2


def test_an_energy_that_is_not_finite_stands_at_the_upper_edge(swing):
    run = made_up(swing, "wild", [(1e-3, 10), (1e-4, 100)])
    found = work_precision(swing, run, rtol=[1e-2, 1e-3], rounds=1)
    wild = dataclasses.replace(found.rows[0], energy_error=INFINITE)
    found = dataclasses.replace(found, rows=(wild, found.rows[1]))
    (axes,) = plot_work_precision(found, "rhs_evaluations", "energy_error").axes
    first, second = (line.get_ydata()[0] for line in points_of(axes))
    assert second == found.rows[1].energy_error < first == axes.get_ylim()[1] < 1.0
    assert found.front("rhs_evaluations", "energy_error") == (found.rows[1],)


def test_points_and_legends_say_what_is_not_known(swing):
    uncounted = made_up(swing, "uncounted", [(1e-3, None)])
    close = made_up(swing, "close", [(0.5e-13, 10)])
    found = work_precision(swing, [uncounted, close], rtol=[1e-2], rounds=1)
    lost, wild = (dataclasses.replace(found.rows[1], energy_error=e) for e in (None, INFINITE))
    both = dataclasses.replace(found, rows=(found.rows[0], lost, wild))
    words, of_wild = hover_words(both, "rhs_evaluations")
    for name in ("max", "final", "rms"):
        assert f"{name} error: < 1.0e-13" in words
    assert f"energy error: < {found.energy_resolution:.1e}" in words
    assert "energy error: not finite" in of_wild
    figure = plot_work_precision(found, "rhs_evaluations", "energy_error")
    texts = [text.get_text() for text in figure.findobj(Text)]
    assert "uncounted (your own): no run here" in texts
    assert "close (your own)" in texts
    assert not any("distance" in text for text in texts)
    assert any("difference from the true energy" in text for text in texts)


def test_other_measures_and_bad_names(study):
    figure = plot_work_precision(study, "steps", "error_final")
    assert figure.axes[0].get_ylabel() == "final error"
    with pytest.raises(InputError, match="cost: 'time' given"):
        plot_work_precision(study, "time")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="did you mean 'error_max'"):
        plot_work_precision(study, "steps", "error_maximum")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="has no energy"):
        plot_work_precision(study, "steps", "energy_error")
