"""When a claim holds, on motions and growths made up for it."""

from __future__ import annotations

import typing

import numpy as np
import pytest

from ropeode import case_studies
from ropeode.analysis import Motion, Thresholds
from ropeode.case_studies import Claim, Comparison, Measure, measured, verdict
from ropeode.errors import InputError
from ropeode.theory import Growth


def motion(swings=4, **more) -> Motion:
    usual = {
        "verdict": "never_settles",
        "diverged_at": None,
        "settled_at": None,
        "unsettled_at": None,
        "swing_times": 30.0 + 50.0 * np.arange(swings),
        "reached_vertical_at": 28,
        "largest_stretch": 0.02,
        "largest_stretch_at": 3,
        "energy": None,
        "energy_at_rest": None,
        "jitter": 0.0,
        "frames": 1000,
        "thresholds": Thresholds(),
    }
    return Motion(**{**usual, **more})


def growth(rate: float) -> Growth:
    grows = rate > 1e-9
    return Growth(64, np.exp(rate / 64), np.exp(rate), rate, 1e-12, 20.0, 40 if grows else None)


TOO_SHORT = "not watched long enough"
STILL, GROWS, DECAYS = growth(0.0), growth(0.1), growth(-0.005)
RESTED = motion(settled_at=300)
LEFT = motion(settled_at=300, unsettled_at=700)
APART = motion(diverged_at=500)
RESTED_THEN_APART = motion(settled_at=300, unsettled_at=700, diverged_at=720)
QUIET = motion(settled_at=300, swings=0)


@pytest.mark.parametrize(
    ("claim", "seen", "theory", "expected"),
    [
        ("diverges", APART, GROWS, "holds"),
        ("diverges", motion(), STILL, "does not hold"),
        ("diverges", RESTED, DECAYS, "does not hold"),
        ("swings", motion(), STILL, "holds"),
        ("swings", motion(swings=0), STILL, "does not hold"),
        ("swings", APART, GROWS, "holds until frame 500"),
        ("settles", RESTED, DECAYS, "holds"),
        ("settles", QUIET, DECAYS, "holds"),
        ("settles", LEFT, GROWS, "holds until frame 700"),
        ("settles", RESTED_THEN_APART, GROWS, "holds until frame 700"),
        ("settles", APART, GROWS, "does not hold"),
        ("settles", motion(frames=1800), DECAYS, "does not hold"),
        ("settles_without_swinging", QUIET, DECAYS, "holds"),
        ("settles_without_swinging", RESTED, DECAYS, "does not hold"),
        ("settles_without_swinging", motion(swings=0, frames=1800), DECAYS, "does not hold"),
        ("never_settles", motion(), STILL, "holds"),
        ("never_settles", motion(), GROWS, "holds"),
        ("never_settles", motion(), DECAYS, "holds until frame 1000"),
        ("never_settles", motion(), growth(-1e-8), "holds until frame 1000"),
        ("never_settles", RESTED, DECAYS, "does not hold"),
        ("never_settles", APART, GROWS, "holds until frame 500"),
        ("never_settles", LEFT, GROWS, "holds"),
    ],
)
def test_verdicts(claim, seen, theory, expected):
    assert verdict(claim, seen, theory) == expected


@pytest.mark.parametrize(
    ("claim", "seen", "theory", "expected"),
    [
        ("diverges", motion(frames=45), GROWS, TOO_SHORT),
        ("diverges", motion(frames=60), DECAYS, "does not hold"),
        ("swings", motion(swings=0, frames=60), DECAYS, TOO_SHORT),
        ("settles", motion(frames=60), DECAYS, TOO_SHORT),
        ("settles", motion(frames=60), GROWS, "does not hold"),
        ("settles", motion(frames=10_000), DECAYS, "does not hold"),
        ("settles_without_swinging", motion(swings=0, frames=60), DECAYS, TOO_SHORT),
        ("settles_without_swinging", motion(swings=3, frames=60), DECAYS, "does not hold"),
        ("never_settles", RESTED, DECAYS, "does not hold"),
    ],
)
def test_what_theory_expects_later_is_no_failure(claim, seen, theory, expected):
    assert verdict(claim, seen, theory) == expected


def test_every_claim_that_moves_can_be_judged():
    for claim in typing.get_args(Claim):
        if claim == "drawn":
            with pytest.raises(InputError):
                verdict(claim, motion(), STILL)
        else:
            assert verdict(claim, motion(), STILL) in ("holds", "does not hold")


def test_rest_is_expected_when_a_thousandth_is_left():
    frame = int(np.ceil(np.log(1000) / 0.005))
    assert f"rest expected near {frame}" in measured(motion(), DECAYS)
    for theory in (STILL, GROWS, growth(-1e-13)):
        assert "rest expected" not in measured(motion(), theory)


def test_words():
    assert measured(motion(swings=1), STILL).startswith("1 swing, moving at frame 1000")
    assert "rest expected" not in measured(RESTED, DECAYS)
    words = measured(RESTED_THEN_APART, GROWS)
    assert "at rest from frame 300 to 700" in words
    assert "flies apart at frame 720" in words
    assert "moving" not in words
    assert measured(QUIET, DECAYS).startswith("no swing, at rest from frame 300")


def compared(measure: Measure, motions: list[Motion]) -> str:
    comparison = Comparison(tuple(range(len(motions))), measure, "in words")
    return case_studies.compared(comparison, motions).verdict


@pytest.mark.parametrize("measure", typing.get_args(Measure))
def test_every_measure_can_be_compared(measure):
    assert compared(measure, [motion(), motion()]) in ("holds", "does not hold")


def test_diverges_later():
    early, late, never = motion(diverged_at=10), motion(diverged_at=90), motion()
    assert compared("diverges_later", [early, late, never]) == "holds"
    assert compared("diverges_later", [early, late, never, never]) == "holds"
    assert compared("diverges_later", [late, early, never]) == "does not hold"
    assert compared("diverges_later", [early, never, late]) == "does not hold"
    assert compared("diverges_later", [early, early, never]) == "does not hold"
    assert compared("diverges_later", [early, late]) == "does not hold"


def test_rests_sooner():
    assert compared("rests_sooner", [motion(), RESTED, motion(settled_at=20)]) == "holds"
    assert compared("rests_sooner", [motion(settled_at=20), RESTED]) == "does not hold"
    assert compared("rests_sooner", [motion(), motion()]) == "does not hold"
    # A rest that does not last is none.
    assert compared("rests_sooner", [RESTED, LEFT]) == "does not hold"


def test_swings_slower():
    slow = motion(swing_times=np.arange(0.0, 300.0, 60.0))
    assert compared("swings_slower", [motion(), slow]) == "holds"
    assert compared("swings_slower", [slow, motion()]) == "does not hold"
    assert compared("swings_slower", [slow, slow]) == "does not hold"
    assert compared("swings_slower", [slow, motion(swing_times=np.zeros(0))]) == "does not hold"


def test_falls_slower():
    assert compared("falls_slower", [motion(), motion(reached_vertical_at=99)]) == "holds"
    assert compared("falls_slower", [motion(), motion(reached_vertical_at=None)]) == "holds"
    assert compared("falls_slower", [motion(), motion()]) == "does not hold"


def test_at_least_as_well():
    assert compared("at_least_as_well", [LEFT, RESTED]) == "holds"
    assert compared("at_least_as_well", [RESTED, RESTED]) == "holds"
    assert compared("at_least_as_well", [RESTED, LEFT]) == "does not hold"
    assert compared("at_least_as_well", [RESTED, APART]) == "does not hold"
    assert compared("at_least_as_well", [motion(), motion()]) == "holds"
