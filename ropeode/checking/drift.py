"""Whether the energy of an undamped problem stays, drifts or grows."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, Literal

import numpy as np

from ropeode.problems.problem import Problem

# A drift is one if it carries the energy further than this many times its own wobble.
_FACTOR = 2.0
# Of the exchanged energy; rounding wanders less.
_LEAST = 1e-9
# Of the same: a change that is no wobble, if the energy then stays at it.
_MUCH = 0.1
_PARTS = 8


@dataclasses.dataclass(frozen=True)
class Drift:
    """What becomes of the energy.

    Arguments:
        verdict: `bounded`: it wobbles; `drifting`: it falls or rises steadily; `growing`: by
            more than there was to exchange, or the run diverged.
        line: the same with numbers.
        evidence: the numbers, relative to the energy that is exchanged between motion and
            height or springs.
    """

    verdict: Literal["bounded", "drifting", "growing"]
    line: str
    evidence: Mapping[str, Any]


def drift_of(problem: Problem, states: np.ndarray) -> Drift:
    """Look at the energy of a long run.

    The energy's mean over each eighth of the run is held against its wobble inside the
    eighths: a bounded error has means that stay, whatever the wobble.

    Arguments:
        problem: undamped, with an energy.
        states: at its sample times, not-a-number from where the run diverged.
    """
    span = float(problem.ts[-1] - problem.ts[0])
    reached = int(np.sum(np.all(np.isfinite(states.reshape(len(states), -1)), axis=1)))
    if reached < len(states):
        at = float(problem.ts[reached])
        return Drift("growing", f"the run diverges at t = {at:g}", {"diverged_at": at})
    energies = problem.energies(states)
    if not np.all(np.isfinite(energies)):
        at = float(problem.ts[int(np.argmin(np.isfinite(energies)))])
        return Drift("growing", f"energy overflows at t = {at:g}", {"diverged_at": at})
    # What is exchanged at first between motion and height or springs is what an error is large
    # beside.
    first = len(states) // _PARTS + 1
    motion = energies[:first] - problem.energies(_without_motion(states[:first]))
    exchanged = float(np.ptp(motion))
    relative = (energies - energies[0]) / exchanged
    parts = np.array_split(relative, _PARTS)
    wobble = max(float(np.ptp(part)) for part in parts)
    slope = float(np.polyfit(np.arange(_PARTS), [np.mean(part) for part in parts], 1)[0]) * _PARTS
    largest = float(np.max(np.abs(relative)))
    evidence = {"drift": slope, "rate": slope / span, "wobble": wobble, "largest": largest}
    if np.max(relative) > 1.0:
        line = f"energy grows to {largest:.1e} times what is exchanged, in {span:g} time units"
        return Drift("growing", line, evidence)
    # What has been lost for good, at first and then no more, has no slope any longer.
    last = float(np.mean(parts[-1]))
    lost = abs(last) > max(_FACTOR * float(np.ptp(parts[-1])), _MUCH)
    if lost or abs(slope) > max(_FACTOR * wobble, _LEAST):
        change = last if lost else slope
        way = "rises" if change > 0 else "falls"
        return Drift(
            "drifting",
            f"energy {way} by {abs(change):.1e} of what is exchanged in {span:g} time units",
            evidence,
        )
    return Drift(
        "bounded",
        f"energy stays within {largest:.1e} of what is exchanged for {span:g} time "
        "units, without drift",
        evidence,
    )


def _without_motion(states: np.ndarray) -> np.ndarray:
    still = states.copy()
    still[:, 1] = 0.0
    return still
