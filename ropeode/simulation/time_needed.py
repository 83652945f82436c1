"""Runs that would take too long are refused, with the number of steps that would not."""

from __future__ import annotations

import math
from typing import Any

from ropeode.validation import bad_value, check_positive

_HOUR_S = 3600.0
# What a run may take where the caller does not say.
LONGEST_S = _HOUR_S
# So many trials that take so long say that a run is too long.
_TRIALS, _LONG_ENOUGH_S = 3, 0.05


def check_longest(seconds: Any) -> float:
    """The time limit of a run, in seconds; infinite for none.

    Raises:
        InputError: it is no number above 0.
    """
    if isinstance(seconds, float) and seconds == math.inf:
        return seconds
    return check_positive("time_limit", seconds, example="3600, or float('inf') for no limit")


class TimeNeeded:
    """What a step of a run takes, until that is known.

    It is the least of several trials: the machine may pause in one, and the first may compile.

    Arguments:
        longest: seconds that the run may take.
        steps_per_frame: of the run.
        frames: likewise.
    """

    def __init__(self, longest: float, steps_per_frame: int, frames: int):
        self._longest, self._steps, self._frames = longest, steps_per_frame, frames
        self._each, self._trials, self.known = math.inf, 0, False

    def tried(self, steps: int, seconds: float) -> bool:
        """Take it into account that so many steps took so long; whether that was long enough.

        Raises:
            InputError: the run would take longer than it may, by all trials.
        """
        self._each, enough = min(self._each, seconds / steps), seconds > _LONG_ENOUGH_S
        self._trials += enough
        needed = self._steps * self._frames * self._each
        self.known = self._trials == _TRIALS or needed <= self._longest
        if not self.known or needed <= self._longest:
            return enough
        of_an_hour = _HOUR_S / self._each / self._frames
        raise bad_value(
            "steps_per_frame",
            self._steps,
            f"a run of at most {self._longest:g} s; these {self._frames} frames would take about "
            f"{_rounded(needed / _HOUR_S)} hours, and {_rounded(of_an_hour)} steps per frame an "
            "hour",
            "take fewer steps or fewer frames, or, where it is worth the time, "
            "simulate(..., time_limit=float('inf'))",
        )


def _rounded(number: float) -> str:
    """To two digits, and as one types it."""
    return f"{float(f'{number:.2g}'):.15g}"
