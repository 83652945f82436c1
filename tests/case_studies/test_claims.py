"""When a claim holds, on motions and growths made up for it."""

from __future__ import annotations

import numpy as np
import pytest

from ropeode.analysis import Motion, Thresholds
from ropeode.case_studies import Comparison, compared, measured, verdict
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


def test_words():
    frame = int(np.ceil(np.log(1000) / 0.005))
    assert measured(motion(swings=1), DECAYS).startswith(
        f"1 swing, moving at frame 1000 (rest expected near {frame})"
    )
    for theory in (STILL, GROWS, growth(-1e-13)):
        assert "rest expected" not in measured(motion(), theory)
    assert measured(RESTED_THEN_APART, GROWS) == (
        "4 swings, at rest from frame 300 to 700, flies apart at frame 720"
    )
    assert measured(QUIET, DECAYS).startswith("no swing, at rest from frame 300, stretch")


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
