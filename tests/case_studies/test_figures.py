"""The facts of the report, as they are packaged."""

from __future__ import annotations

import dataclasses
import typing

import numpy as np
import pytest

from ropeode.case_studies import Claim, Measure, all_comparisons, all_figures, rope_report
from ropeode.errors import InputError
from ropeode.steppers import as_stepper

# The rope is drawn to the left of its pin and to the right.
ENDS = ((-400.0, 200.0), (400.0, 200.0))


def test_figures_and_comparisons_are_there():
    figures = all_figures()
    assert list(figures) == list(range(1, 42))
    for figure in figures.values():
        assert figure.claim in typing.get_args(Claim)
        assert (figure.run_as is None) == (figure.claim == "drawn") == (figure.stepper == "none")
        assert figure.words
    for each in all_comparisons():
        assert each.measure in typing.get_args(Measure)
        assert set(each.figures) <= set(figures)


def test_settings_are_those_of_the_report():
    """As its README gives them: start, ends, mass, stiffness, gravity, pin."""
    # Many differ in their steps alone, which no problem depends on.
    moving = {
        dataclasses.replace(figure, figure=0, steps_per_frame=1, claim="swings", words="")
        for figure in all_figures().values()
        if figure.run_as
    }
    for figure in moving:
        for end in ENDS:
            problem = figure.setting("words").problem(end, 5)
            assert problem.frames == 5
            x, v = problem.y0
            np.testing.assert_array_equal(x[:, 0], [0, 200])
            np.testing.assert_array_equal(x[:, -1], end)
            assert x.shape == (2, figure.num_nodes)
            assert not np.any(v)
            args = problem.args
            np.testing.assert_array_equal(args.mass, 1)
            np.testing.assert_array_equal(args.gravity[:, 0], [0, -1])
            np.testing.assert_array_equal(args.free, [0] + [1] * (figure.num_nodes - 1))
            np.testing.assert_array_equal(args.damping, figure.damping)
            if figure.stepper != "constraint_verlet":
                np.testing.assert_array_equal(args.stiffness, 100)


def test_programs_damp_as_the_report_lists_them():
    """The listing of the force Verlet damps nothing; both Verlets start at rest."""
    for figure in all_figures().values():
        listing = figure.stepper == "force_verlet"
        assert ("listing" in figure.meanings) == listing
        assert ("words" in figure.meanings) == (figure.run_as is not None)
        if listing:
            assert not np.any(figure.setting("listing").problem(ENDS[0], 1).args.damping)
        if "verlet" in figure.stepper:
            chosen = as_stepper(figure.run_as)
            assert (chosen.start, chosen.damping) == ("rest", "per-step")
            assert getattr(chosen, "sweeps", 1) == 1


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        *((([each],), "figures: .*given; allowed: .*Fix: ") for each in (0, 42, "x", 1.5)),
        (([],), "figures: .*given; allowed: .*Fix: "),
        *((([4], frames), "frames: .*whole number >= 1") for frames in (0, 1.5, "many")),
    ],
)
def test_bad_arguments(arguments, words):
    with pytest.raises(InputError, match=words):
        rope_report(*arguments)


def test_figures_are_taken_once_and_in_order():
    """These do not move, so that nothing has to be run."""
    assert [each.figure.figure for each in rope_report(["2", 1, 2.0]).figures] == [1, 2]
