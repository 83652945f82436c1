"""The facts of the report, as they are packaged."""

from __future__ import annotations

import functools
import typing

import pytest

from ropeode.case_studies import Claim, Measure, all_comparisons, all_figures, rope_report
from ropeode.errors import InputError
from ropeode.problems import InextensibleRope, Rope
from ropeode.steppers import as_stepper


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


AS_IN_ITS_README = {
    "start": (0.0, 200.0),
    "node_mass": 1.0,
    "gravity": (0.0, -1.0),
    "pinned": (0,),
    "initial_velocity": (0.0, 0.0),
}


def test_settings_are_those_of_the_report():
    """The listing of the force Verlet damps nothing; both Verlets start at rest."""
    for figure in all_figures().values():
        listing = figure.stepper == "force_verlet"
        words = ("words", "listing") if listing else ("words",)
        assert figure.meanings == (words if figure.run_as else ())
        for meaning in figure.meanings:
            rope = {**AS_IN_ITS_README, "num_nodes": figure.num_nodes}
            rope["damping"] = 0.0 if meaning == "listing" else figure.damping
            rigid = figure.stepper == "constraint_verlet"
            kind = InextensibleRope if rigid else functools.partial(Rope, stiffness=100.0)
            # The rope is drawn to the left of its pin and to the right.
            for end in ((-400.0, 200.0), (400.0, 200.0)):
                expected = kind(end=end, **rope).problem(5).parameters
                assert figure.setting(meaning).problem(end, 5).parameters == expected
        if "verlet" in figure.stepper:
            chosen = as_stepper(figure.run_as)
            assert (chosen.start, chosen.damping) == ("rest", "per-step")
            assert getattr(chosen, "sweeps", 1) == 1


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        *((each, "figures: .*given; allowed: .*Fix: ") for each in ([[0]], [[42]], [["x"]], [[]])),
        *((([4], frames), "frames: .*whole number >= 1") for frames in (0, 1.5, "many")),
    ],
)
def test_bad_arguments(arguments, words):
    with pytest.raises(InputError, match=words):
        rope_report(*arguments)


def test_figures_are_taken_once_and_in_order():
    """These do not move, so that nothing has to be run."""
    assert [each.figure.figure for each in rope_report(["2", 1, 2.0]).figures] == [1, 2]
