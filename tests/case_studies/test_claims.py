"""The facts of the report as they are packaged; and when a claim holds, on made-up motions."""

from __future__ import annotations

import dataclasses
import functools
import typing

import numpy as np
import pytest

from ropeode.analysis import Motion
from ropeode.case_studies import (
    Claim,
    Comparison,
    Measure,
    all_comparisons,
    all_figures,
    compared,
    rope_report,
    verdict,
)
from ropeode.errors import InputError
from ropeode.problems import InextensibleRope, Rope
from ropeode.steppers import as_stepper
from ropeode.theory import Growth
from tests.render.made_up import MADE_UP

RESTS = MADE_UP["report"]().figures[1].readings[0].motion


def motion(swings=4, **more) -> Motion:
    """A rope that swings on, but for what is said otherwise."""
    usual = {
        "settled_at": None,
        "swing_times": 30.0 + 50.0 * np.arange(swings),
        "reached_vertical_at": 28,
        "largest_stretch": 0.02,
        "frames": 1000,
    }
    return dataclasses.replace(RESTS, **{**usual, **more})


def growth(rate: float) -> Growth:
    grows = rate > 1e-9
    return Growth(64, np.exp(rate / 64), np.exp(rate), rate, 1e-12, 20.0, 40 if grows else None)


STILL, GROWS, DECAYS = growth(0.0), growth(0.1), growth(-0.005)
RESTED = motion(settled_at=300)
LEFT = motion(settled_at=300, unsettled_at=700)
APART = motion(diverged_at=500)
RESTED_THEN_APART = motion(settled_at=300, unsettled_at=700, diverged_at=720)
QUIET = motion(settled_at=300, swings=0)


CLAIMS = ("diverges", "swings", "settles", "settles_without_swinging", "never_settles")


@pytest.mark.parametrize(
    ("seen", "theory", "expected"),
    [
        (APART, GROWS, "yes, until 500, no, no, until 500"),
        (RESTED, DECAYS, "no, yes, yes, no, no"),
        (QUIET, DECAYS, "no, no, yes, yes, no"),
        (LEFT, GROWS, "no, yes, until 700, no, yes"),
        (RESTED_THEN_APART, GROWS, "yes, until 720, until 700, no, until 720"),
        (motion(), STILL, "no, yes, no, no, yes"),
        (motion(swings=0), STILL, "no, no, no, no, yes"),
        (motion(), growth(-1e-8), "no, yes, late, no, until 1000"),
        (motion(frames=1800), DECAYS, "no, yes, no, no, until 1800"),
        (motion(frames=60), DECAYS, "no, yes, late, no, until 60"),
        (motion(swings=0, frames=60), DECAYS, "no, late, late, late, until 60"),
        (motion(frames=60), GROWS, "no, yes, no, no, yes"),
        (motion(frames=45), GROWS, "late, yes, no, no, yes"),
    ],
)
def test_verdicts(seen, theory, expected):
    """Of each claim; what theory expects later is no failure, but not watched long enough."""
    words = {"yes": "holds", "no": "does not hold", "late": "not watched long enough"}
    for claim, word in zip(CLAIMS, expected.split(", "), strict=True):
        until = word.replace("until", "holds until frame")
        assert verdict(claim, seen, theory) == words.get(word, until)


EARLY, LATE, SOON = motion(diverged_at=10), motion(diverged_at=90), motion(settled_at=20)
ON, SLOW = motion(), motion(swing_times=np.arange(0.0, 300.0, 60.0))
# Motions in whose order each comparison holds, and others.
COMPARISONS = {
    "diverges_later": ([(EARLY, LATE, ON)], [(LATE, EARLY, ON), (EARLY, EARLY, ON), (EARLY, LATE)]),
    # A rest that does not last is none.
    "rests_sooner": ([(ON, RESTED, SOON)], [(SOON, RESTED), (ON, ON), (RESTED, LEFT)]),
    "swings_slower": ([(ON, SLOW)], [(SLOW, ON), (SLOW, SLOW), (SLOW, motion(swings=0))]),
    "falls_slower": (
        [(ON, motion(reached_vertical_at=99)), (ON, motion(reached_vertical_at=None))],
        [(ON, ON)],
    ),
    "at_least_as_well": ([(LEFT, RESTED), (ON, ON)], [(RESTED, LEFT)]),
}


@pytest.mark.parametrize("measure", COMPARISONS)
def test_comparisons(measure):
    for holds, cases in zip(("holds", "does not hold"), COMPARISONS[measure], strict=True):
        for motions in cases:
            comparison = Comparison(tuple(range(len(motions))), measure, "in words")
            assert compared(comparison, motions).verdict == holds


AS_IN_ITS_README = {
    "start": (0.0, 200.0),
    "node_mass": 1.0,
    "gravity": (0.0, -1.0),
    "pinned": (0,),
    "initial_velocity": (0.0, 0.0),
}


def test_settings_are_those_of_the_report():
    """The listing of the force Verlet damps nothing; both Verlets start at rest."""
    figures = all_figures()
    assert list(figures) == list(range(1, 42))
    assert {each.measure for each in all_comparisons()} <= {*typing.get_args(Measure)}
    for figure in figures.values():
        assert figure.claim in typing.get_args(Claim)
        assert (figure.run_as is None) == (figure.claim == "drawn") == (figure.stepper == "none")
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


def test_figures_are_taken_once_and_in_order_and_others_are_refused():
    """These do not move, so that nothing has to be run."""
    assert [each.figure.figure for each in rope_report(["2", 1, 2.0]).figures] == [1, 2]
    for figures in ([0], [42], ["x"], [1.5], []):
        with pytest.raises(InputError, match="figures: .*given; allowed: .*Fix: "):
            rope_report(figures)
    for frames in (0, 1.5, "many"):
        with pytest.raises(InputError, match="frames: .*whole number >= 1"):
            rope_report([4], frames)
