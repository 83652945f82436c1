"""Runs that would take too long are refused, with the number of steps that would not."""

from __future__ import annotations

from typing import Any

from ropeode.validation import bad_value

_HOUR_S = 3600.0
# What a run may take where the caller does not say.
LONGEST_S = _HOUR_S


def check_longest(seconds: Any) -> float:
    """The time limit of a run, in seconds; infinite for none.

    Raises:
        InputError: it is no number above 0.
    """
    try:
        limit = float(seconds)
        if limit > 0.0:
            return limit
    except (TypeError, ValueError, OverflowError):
        pass
    allowed = "seconds, a number above 0; float('inf') for no limit"
    raise bad_value("time_limit", seconds, allowed, "for example 3600")


def refuse_longer(longest: float, each: float, steps_per_frame: int, frames: int) -> None:
    """See that a run does not take too long.

    Arguments:
        longest: seconds that it may take.
        each: seconds of a step.
        steps_per_frame: of the run.
        frames: likewise.

    Raises:
        InputError: it would take longer.
    """
    seconds, of_an_hour = steps_per_frame * frames * each, _HOUR_S / each / frames
    if seconds > longest:
        raise bad_value(
            "steps_per_frame",
            steps_per_frame,
            f"a run of at most {longest:g} s; these {frames} frames would take about "
            f"{_rounded(seconds / _HOUR_S)} hours, and {_rounded(of_an_hour)} steps per frame an "
            "hour",
            "take fewer steps or fewer frames, or, where it is worth the time, "
            "simulate(..., time_limit=float('inf'))",
        )


def _rounded(number: float) -> str:
    """To two digits, and as one types it."""
    return f"{float(f'{number:.2g}'):.15g}"
