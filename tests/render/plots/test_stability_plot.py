"""The picture of a region of stability."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from ropeode import load, plot_stability
from ropeode.errors import InputError
from ropeode.problems import PROBLEMS
from ropeode.study import Explanation
from ropeode.theory import Spectrum, StabilityFunction, linear_stability_of, stability_region
from tests.render.plots.legible import assert_legible


@pytest.fixture(scope="module")
def drawn():
    """Explicit Euler on an oscillator with the eigenvalues -0.1 +- i, and one that grows."""
    stored = load("oscillator")
    problem = PROBLEMS["oscillator"](damping=0.2, stiffness=1.01, frames=stored.problem.frames)
    assert problem.exact is not None
    given = dataclasses.replace(stored, problem=problem, states=problem.exact(problem.ts))
    found = linear_stability_of(given, "explicit-euler")
    assert isinstance(found.function, StabilityFunction)
    assert found.limits is not None
    region = stability_region(found.function, found.limits, points=41)
    assert region is not None
    modes = np.append(found.along.eigenvalues[0], [0.5, 100.0])
    along = Spectrum(np.zeros(1), modes[None], np.full(1, 1e-9))
    stability = dataclasses.replace(found, along=along)
    # All that the picture reads of an explanation.
    rows = [SimpleNamespace(steps_per_frame=steps) for steps in (1, 4, 6, 8, 10)]
    known = {"stepper": "explicit-euler", "tables": (SimpleNamespace(rows=rows),)}
    return explanation_of(**known, region=region, stability=stability)


def explanation_of(**fields):
    explanation = object.__new__(Explanation)
    vars(explanation).update(fields)
    return explanation


def test_eigenvalues_are_where_dt_puts_them_and_the_title_states_the_limit(drawn):
    figure = plot_stability(drawn, [4, 1])
    # |1 + dt lambda| < 1 for dt < 0.2/1.01.
    assert "stable for dt < 0.198, 6 per frame or more" in figure.get_suptitle()
    (axes,) = figure.axes
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("Re z,  z = dt λ", "Im z")
    points = [line for line in axes.lines if line.get_linestyle() == "None"]
    hollow = [line for line in points if line.get_markerfacecolor() == "none"]
    filled = [line for line in points if line not in hollow]
    for dt, grows, decays in zip((1.0, 0.25), hollow, filled, strict=True):
        np.testing.assert_allclose(grows.get_xydata(), [[0.5 * dt, 0.0]])
        expected = dt * np.array([[-0.1, 1.0], [-0.1, -1.0]])
        np.testing.assert_allclose(decays.get_xydata(), expected, atol=1e-12)
    assert [text.get_text() for text in figure.legends[0].get_texts()] == [
        "nothing grows: |R(z)| ≤ 1",
        "eigenvalues at 1 step/frame (1 of 4 outside)",
        "eigenvalues at 4 steps/frame (1 of 4 outside)",
    ]


def test_the_coarsest_runs_are_drawn_by_default_and_all_is_legible(drawn):
    figure = plot_stability(drawn)
    assert_legible(figure)
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert [label.split()[2] for label in labels[1:]] == ["1", "4", "6", "8"]


def test_a_stepper_without_a_region(drawn):
    without = explanation_of(**{**vars(drawn), "region": None})
    with pytest.raises(InputError, match="explanation: 'explicit-euler' given; allowed: .* Fix: "):
        plot_stability(without)
    with pytest.raises(InputError, match="steps_per_frame: .0. given"):
        plot_stability(drawn, [0])
