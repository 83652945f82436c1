"""Claims that compare figures."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from ropeode.analysis.motion import Motion
from ropeode.case_studies.claims import FAILS, HOLDS
from ropeode.case_studies.figures import Comparison, Measure

# A period must be longer by this part to count as slower; differences below it are what
# sampling once per frame leaves.
_SLOWER = 1e-3


class Compared(NamedTuple):
    """A comparison, judged.

    Fields:
        comparison: the claim.
        measured: what was found, figure by figure.
        verdict: `holds` or `does not hold`.
    """

    comparison: Comparison
    measured: str
    verdict: str


def judge(comparison: Comparison, motions: Sequence[Motion]) -> Compared:
    """Whether a comparison holds.

    Arguments:
        comparison: the claim.
        motions: of its figures, in the order in which it names them.
    """
    words, holds = _MEASURES[comparison.measure](motions)
    each = "; ".join(
        f"{figure}: {found}" for figure, found in zip(comparison.figures, words, strict=True)
    )
    return Compared(comparison, each, HOLDS if holds else FAILS)


def _falling(numbers: Sequence[float]) -> bool:
    return all(later < sooner for sooner, later in itertools.pairwise(numbers))


def _rest(motion: Motion) -> float:
    """The frame of coming to rest for good; infinite where that was not seen."""
    if motion.settled_at is None or motion.unsettled_at is not None:
        return math.inf
    return motion.settled_at


def _period(motion: Motion) -> float:
    """The mean period of the swings; NaN for fewer than two."""
    passed = motion.swing_times
    return 2.0 * float(np.mean(np.diff(passed))) if len(passed) > 1 else math.nan


def _diverges_later(motions: Sequence[Motion]) -> tuple[list[str], bool]:
    frames = [math.inf if m.diverged_at is None else m.diverged_at for m in motions]
    words = [
        f"to the end ({m.frames})" if m.diverged_at is None else f"to frame {m.diverged_at}"
        for m in motions
    ]
    ends = [frame for frame in frames if math.isfinite(frame)]
    # Later each time; and once one survives, so do the rest.
    return words, _falling(ends[::-1]) and frames == sorted(frames) and len(ends) < len(frames)


def _rests_sooner(motions: Sequence[Motion]) -> tuple[list[str], bool]:
    rests = [_rest(m) for m in motions]
    words = [f"rest at {rest:.0f}" if math.isfinite(rest) else "no rest" for rest in rests]
    return words, _falling(rests)


def _swings_slower(motions: Sequence[Motion]) -> tuple[list[str], bool]:
    periods = [_period(m) for m in motions]
    words = [
        f"period {period:.2f} frames, {m.swings} swings"
        for period, m in zip(periods, motions, strict=True)
    ]
    return words, all(
        later > sooner * (1 + _SLOWER) for sooner, later in itertools.pairwise(periods)
    )


def _falls_slower(motions: Sequence[Motion]) -> tuple[list[str], bool]:
    reached = [
        math.inf if m.reached_vertical_at is None else m.reached_vertical_at for m in motions
    ]
    words = [
        "not down yet" if math.isinf(frame) else f"down at frame {frame:.0f}" for frame in reached
    ]
    return words, _falling(reached[::-1])


def _at_least_as_well(motions: Sequence[Motion]) -> tuple[list[str], bool]:
    """Whether the second neither flies apart nor leaves its rest before the first does."""
    frames = [
        math.inf
        if m.diverged_at is None and m.unsettled_at is None
        else min(frame for frame in (m.diverged_at, m.unsettled_at) if frame is not None)
        for m in motions
    ]
    rests = [_rest(m) for m in motions]
    words = [
        (f"rest at {m.settled_at}" if m.settled_at is not None else "no rest")
        + ("" if math.isinf(frame) else f", spoilt at {frame:.0f}")
        for m, frame in zip(motions, frames, strict=True)
    ]
    first, second = frames
    return words, second >= first and (math.isinf(rests[0]) or math.isfinite(rests[1]))


_MEASURES: dict[Measure, Callable[[Sequence[Motion]], tuple[list[str], bool]]] = {
    "diverges_later": _diverges_later,
    "rests_sooner": _rests_sooner,
    "swings_slower": _swings_slower,
    "falls_slower": _falls_slower,
    "at_least_as_well": _at_least_as_well,
}
