"""Whether the energy of an undamped problem is bounded, drifts or grows."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, Literal

import numpy as np

from ropeode.problems import Problem

# A drift changes the energy by more than so many times its oscillation.
_FACTOR = 2.0
# As a part of the exchanged energy; rounding alone changes less.
_SMALLEST = 1e-9
# Likewise: a lasting change that is larger is not an oscillation.
_LASTING = 0.1
_PARTS = 8


@dataclasses.dataclass(frozen=True)
class Drift:
    """How the energy behaves in a long run.

    Arguments:
        verdict: `bounded`: it oscillates; `drifting`: it falls or rises steadily; `growing`: by
            more than the exchanged energy, or the run diverged.
        line: the same with numbers.
        evidence: the numbers, relative to the energy that is exchanged between kinetic and
            potential energy.
    """

    verdict: Literal["bounded", "drifting", "growing"]
    line: str
    evidence: Mapping[str, Any]


def measure_drift(problem: Problem, states: np.ndarray) -> Drift:
    """Measure the drift of the energy in a long run.

    The means of the energy over each eighth of the run are compared with its oscillation inside
    the eighths: if the error is bounded, the means stay, however large the oscillation is.

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
    # Errors are measured in units of the energy that is exchanged at first between kinetic and
    # potential energy.
    first = len(states) // _PARTS + 1
    kinetic = energies[:first] - problem.energies(at_rest(states[:first]))
    exchanged = float(np.ptp(kinetic))
    relative = (energies - energies[0]) / exchanged
    parts = np.array_split(relative, _PARTS)
    oscillation = max(float(np.ptp(part)) for part in parts)
    slope = float(np.polyfit(np.arange(_PARTS), [np.mean(part) for part in parts], 1)[0]) * _PARTS
    largest = float(np.max(np.abs(relative)))
    evidence = {"drift": slope, "rate": slope / span, "wobble": oscillation, "largest": largest}
    if np.max(relative) > 1.0:
        line = f"energy grows to {largest:.1e} times the exchanged energy in {span:g} time units"
        return Drift("growing", line, evidence)
    # Energy that is lost at first, and then no more, leaves no slope.
    last = float(np.mean(parts[-1]))
    lost = abs(last) > max(_FACTOR * float(np.ptp(parts[-1])), _LASTING)
    if lost or abs(slope) > max(_FACTOR * oscillation, _SMALLEST):
        change = last if lost else slope
        way = "rises" if change > 0 else "falls"
        return Drift(
            "drifting",
            f"energy {way} by {abs(change):.1e} of the exchanged energy in {span:g} time units",
            evidence,
        )
    return Drift(
        "bounded",
        f"energy stays within {largest:.1e} of the exchanged energy for {span:g} time units, "
        "without drift",
        evidence,
    )


def at_rest(states: np.ndarray) -> np.ndarray:
    """The same states with velocities set to zero."""
    still = states.copy()
    still[:, 1] = 0.0
    return still
