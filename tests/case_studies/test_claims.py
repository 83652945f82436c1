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
        ("diverges", RESTED, DECAYS, "does not hold"),
        ("diverges", motion(frames=45), GROWS, TOO_SHORT),
        ("diverges", motion(frames=60), DECAYS, "does not hold"),
        ("swings", motion(), STILL, "holds"),
        ("swings", motion(swings=0), STILL, "does not hold"),
        ("swings", motion(swings=0, frames=60), DECAYS, TOO_SHORT),
        ("swings", APART, GROWS, "holds until frame 500"),
        ("settles", RESTED, DECAYS, "holds"),
        ("settles", QUIET, DECAYS, "holds"),
        ("settles", LEFT, GROWS, "holds until frame 700"),
        ("settles", RESTED_THEN_APART, GROWS, "holds until frame 700"),
        ("settles", APART, GROWS, "does not hold"),
        ("settles", motion(frames=1800), DECAYS, "does not hold"),
        ("settles", motion(frames=60), DECAYS, TOO_SHORT),
        ("settles", motion(frames=60), GROWS, "does not hold"),
        ("settles_without_swinging", QUIET, DECAYS, "holds"),
        ("settles_without_swinging", RESTED, DECAYS, "does not hold"),
        ("settles_without_swinging", motion(swings=0, frames=60), DECAYS, TOO_SHORT),
        ("settles_without_swinging", motion(swings=3, frames=60), DECAYS, "does not hold"),
        ("never_settles", motion(), STILL, "holds"),
        ("never_settles", motion(), GROWS, "holds"),
        ("never_settles", motion(), growth(-1e-8), "holds until frame 1000"),
        ("never_settles", RESTED, DECAYS, "does not hold"),
        ("never_settles", APART, GROWS, "holds until frame 500"),
        ("never_settles", LEFT, GROWS, "holds"),
    ],
)
def test_verdicts(claim, seen, theory, expected):
    """What theory expects later is no failure, but not watched long enough."""
    assert verdict(claim, seen, theory) == expected


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


EARLY, LATE, SOON = motion(diverged_at=10), motion(diverged_at=90), motion(settled_at=20)
ON, SLOW = motion(), motion(swing_times=np.arange(0.0, 300.0, 60.0))


@pytest.mark.parametrize(
    ("measure", "motions", "holds"),
    [
        ("diverges_later", [EARLY, LATE, ON], True),
        ("diverges_later", [LATE, EARLY, ON], False),
        ("diverges_later", [EARLY, ON, LATE], False),
        ("diverges_later", [EARLY, EARLY, ON], False),
        ("diverges_later", [EARLY, LATE], False),
        ("rests_sooner", [ON, RESTED, SOON], True),
        ("rests_sooner", [SOON, RESTED], False),
        ("rests_sooner", [ON, ON], False),
        # A rest that does not last is none.
        ("rests_sooner", [RESTED, LEFT], False),
        ("swings_slower", [ON, SLOW], True),
        ("swings_slower", [SLOW, ON], False),
        ("swings_slower", [SLOW, SLOW], False),
        ("swings_slower", [SLOW, motion(swing_times=np.zeros(0))], False),
        ("falls_slower", [ON, motion(reached_vertical_at=99)], True),
        ("falls_slower", [ON, motion(reached_vertical_at=None)], True),
        ("falls_slower", [ON, ON], False),
        ("at_least_as_well", [LEFT, RESTED], True),
        ("at_least_as_well", [ON, ON], True),
        ("at_least_as_well", [RESTED, LEFT], False),
    ],
)
def test_comparisons(measure, motions, holds):
    comparison = Comparison(tuple(range(len(motions))), measure, "in words")
    assert compared(comparison, motions).verdict == ("holds" if holds else "does not hold")
