"""When a claim holds, on motions and growths made up for it."""

from __future__ import annotations

import dataclasses
import typing

import numpy as np
import pytest

from ropeode.analysis import Motion, Thresholds
from ropeode.case_studies import claims, comparisons
from ropeode.case_studies.figures import Claim, all_comparisons
from ropeode.errors import InputError
from ropeode.theory.growth import Growth


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


STILL, GROWS, DECAYS = growth(0.0), growth(0.1), growth(-0.005)
RESTED = motion(settled_at=300)
LEFT = motion(settled_at=300, unsettled_at=700)
APART = motion(diverged_at=500)
RESTED_THEN_APART = motion(settled_at=300, unsettled_at=700, diverged_at=720)
QUIET = motion(settled_at=300, swings=0)


@pytest.mark.parametrize(
    ("claim", "seen", "theory", "verdict"),
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
def test_verdicts(claim, seen, theory, verdict):
    assert claims.verdict(claim, seen, theory) == verdict


@pytest.mark.parametrize(
    ("claim", "seen", "theory", "verdict"),
    [
        ("diverges", motion(frames=45), GROWS, claims.TOO_SHORT),
        ("diverges", motion(frames=60), DECAYS, "does not hold"),
        ("swings", motion(swings=0, frames=60), DECAYS, claims.TOO_SHORT),
        ("settles", motion(frames=60), DECAYS, claims.TOO_SHORT),
        ("settles", motion(frames=60), GROWS, "does not hold"),
        ("settles", motion(frames=10_000), DECAYS, "does not hold"),
        ("settles_without_swinging", motion(swings=0, frames=60), DECAYS, claims.TOO_SHORT),
        ("settles_without_swinging", motion(swings=3, frames=60), DECAYS, "does not hold"),
        ("never_settles", RESTED, DECAYS, "does not hold"),
    ],
)
def test_what_theory_expects_later_is_no_failure(claim, seen, theory, verdict):
    assert claims.verdict(claim, seen, theory) == verdict


def test_every_claim_that_moves_can_be_judged():
    for claim in typing.get_args(Claim):
        if claim == "drawn":
            with pytest.raises(InputError):
                claims.verdict(claim, motion(), STILL)
        else:
            assert claims.verdict(claim, motion(), STILL) in (claims.HOLDS, claims.FAILS)


def test_rest_is_expected_when_a_thousandth_is_left():
    assert claims.rest_expected(motion(), DECAYS) == int(np.ceil(np.log(1000) / 0.005))
    assert claims.rest_expected(motion(), STILL) is None
    assert claims.rest_expected(motion(), GROWS) is None
    assert claims.rest_expected(motion(), growth(-1e-13)) is None


def test_words():
    assert claims.measured(motion(swings=1), STILL).startswith("1 swing, moving at frame 1000")
    assert "rest expected near 1382" in claims.measured(motion(), DECAYS)
    assert "rest expected" not in claims.measured(RESTED, DECAYS)
    words = claims.measured(RESTED_THEN_APART, GROWS)
    assert "at rest from frame 300 to 700" in words
    assert "flies apart at frame 720" in words
    assert "moving" not in words
    assert claims.measured(QUIET, DECAYS).startswith("no swing, at rest from frame 300")


def compared(measure: str, motions: list[Motion]) -> str:
    comparison = next(each for each in all_comparisons() if each.measure == measure)
    comparison = dataclasses.replace(comparison, figures=tuple(range(len(motions))))
    return comparisons.compared(comparison, motions).verdict


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
