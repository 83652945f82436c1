"""Claims that compare figures."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from ropeode.analysis import Motion
from ropeode.case_studies.claims import FAILS, HOLDS
from ropeode.case_studies.figures import Comparison, Measure
from ropeode.json_form import json_shows

# A period must be longer by this part to count as slower; differences below it are what
# sampling once per frame leaves.
_SLOWER = 1e-3


@json_shows("comparison.figures", "comparison.claim", "measured", "verdict")
class Compared(NamedTuple):
    """A comparison and what became of it.

    Fields:
        comparison: the claim.
        measured: what each figure showed, in words.
        verdict: `holds`, `does not hold` or `not watched long enough`.
    """

    comparison: Comparison
    measured: str
    verdict: str


def compared(comparison: Comparison, motions: Sequence[Motion]) -> Compared:
    """Test whether a comparison holds.

    Arguments:
        comparison: the claim.
        motions: of its figures, in the order in which it names them.
    """
    measure, words, holds = _MEASURES[comparison.measure]
    measured = "; ".join(
        f"{figure}: {words(motion)}"
        for figure, motion in zip(comparison.figures, motions, strict=True)
    )
    verdict = HOLDS if holds([measure(motion) for motion in motions]) else FAILS
    return Compared(comparison, measured, verdict)


def _frame_or_never(frame: int | None) -> float:
    return math.inf if frame is None else frame


def _apart(motion: Motion) -> float:
    return _frame_or_never(motion.diverged_at)


def _rest(motion: Motion) -> float:
    """The frame of coming to rest for good."""
    return math.inf if motion.unsettled_at is not None else _frame_or_never(motion.settled_at)


def _period(motion: Motion) -> float:
    """The mean period of the swings; NaN for fewer than two."""
    passed = motion.swing_times
    return 2.0 * float(np.mean(np.diff(passed))) if len(passed) > 1 else math.nan


def _down(motion: Motion) -> float:
    return _frame_or_never(motion.reached_vertical_at)


def _spoilt(motion: Motion) -> float:
    """The frame of flying apart, or of leaving the rest."""
    return min(_apart(motion), _frame_or_never(motion.unsettled_at))


def _rising(numbers: Sequence[float], by: float = 0.0) -> bool:
    return all(second > first * (1.0 + by) for first, second in itertools.pairwise(numbers))


def _later_and_then_never(frames: Sequence[float]) -> bool:
    ends = [frame for frame in frames if math.isfinite(frame)]
    return _rising(ends) and list(frames) == sorted(frames) and len(ends) < len(frames)


def _at_least_as_well(each: Sequence[tuple[float, float]]) -> bool:
    """Whether the second neither flies apart nor leaves its rest sooner than the first."""
    (first_spoilt, first_rest), (spoilt, rest) = each
    return spoilt >= first_spoilt and (math.isinf(first_rest) or math.isfinite(rest))


def _words(frame: float, at: str, never: str) -> str:
    return never if math.isinf(frame) else f"{at} {frame:.0f}"


# What is measured of each motion, in words, and what holds of the measurements in their order.
_MEASURES: dict[Measure, tuple[Callable, Callable[[Motion], str], Callable[[Sequence], bool]]] = {
    "diverges_later": (
        _apart,
        lambda motion: _words(_apart(motion), "to frame", f"to the end ({motion.frames})"),
        _later_and_then_never,
    ),
    "rests_sooner": (
        _rest,
        lambda motion: _words(_rest(motion), "rest at", "no rest"),
        lambda frames: _rising(frames[::-1]),
    ),
    "swings_slower": (
        _period,
        lambda motion: f"period {_period(motion):.2f} frames, {motion.swings} swings",
        lambda periods: _rising(periods, by=_SLOWER),
    ),
    "falls_slower": (
        _down,
        lambda motion: _words(_down(motion), "down at frame", "not down yet"),
        _rising,
    ),
    "at_least_as_well": (
        lambda motion: (_spoilt(motion), _rest(motion)),
        lambda motion: (
            _words(_frame_or_never(motion.settled_at), "rest at", "no rest")
            + _words(_spoilt(motion), ", spoilt at", "")
        ),
        _at_least_as_well,
    ),
}
