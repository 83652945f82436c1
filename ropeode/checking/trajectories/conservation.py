"""Whether pinned nodes stay in place, and whether undamped motion conserves energy."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ropeode.checking.energy_drift import at_rest, measure_drift
from ropeode.checking.report import Finding, exactly
from ropeode.checking.trajectories.run_files import Run
from ropeode.references import Reference

# A pinned node may move by so many units of rounding of the problem's size.
_PIN_ROUNDINGS = 500.0
# A problem conserves energy if a certified solution loses less than this part of the exchanged
# energy.
_CONSERVED = 1e-6
# Fewer samples do not distinguish a drift from an oscillation.
_FEWEST = 64


def pins_finding(reference: Reference, runs: Sequence[Run]) -> Finding:
    """Whether pinned nodes stay in place."""
    problem, dim = reference.problem, runs[0].layout.dim
    free = getattr(problem.args, "free", None)
    if free is None or np.all(free):
        return Finding("pins", "skip", "no node is pinned")
    pinned = np.flatnonzero(np.asarray(free) == 0.0)
    worst, line = 0.0, ""
    for run in runs:
        places = run.values[: run.reached, pinned, :dim]
        moved = np.max(np.abs(places - places[0]), axis=2)
        largest = float(np.max(moved))
        if largest > max(worst, _PIN_ROUNDINGS * run.epsilon * problem.scale):
            sample, node = np.unravel_index(np.argmax(moved), moved.shape)
            line = (
                f"pinned node {pinned[node]} is {largest:.1e} away from its place at t = "
                f"{problem.ts[sample]:g} (dt = {run.dt:g})"
            )
        worst = max(worst, largest)
    if line:
        return Finding("pins", "fail", line, {"moved": worst})
    return Finding("pins", "pass", f"pinned nodes stay in place {exactly(worst)}", {"moved": worst})


def energy_finding(reference: Reference, runs: Sequence[Run]) -> Finding:
    """How the energy behaves at the largest and smallest steps, if the problem conserves it."""
    problem = reference.problem
    if problem.energy is None or problem.mechanics is None:
        return Finding("energy", "skip", "the problem has no energy")
    if runs[0].quantities != problem.quantities:
        return Finding("energy", "skip", "the files have no velocities")
    states = reference.states[: reference.trusted]
    energies = problem.energies(states)
    exchanged = float(np.ptp(energies - problem.energies(at_rest(states))))
    if exchanged == 0.0 or np.ptp(energies) > _CONSERVED * exchanged:
        return Finding("energy", "skip", "the problem does not conserve its energy")
    if len(problem.ts) < _FEWEST:
        return Finding(
            "energy", "skip", f"needs {_FEWEST} samples to distinguish a drift from an oscillation"
        )
    lines, evidence = [], {}
    with np.errstate(all="ignore"):
        for run in (runs[0], runs[-1]):
            drift = measure_drift(problem, run.states)
            lines.append(f"dt {run.dt:g}: {drift.line}")
            evidence[f"{run.dt:g}"] = {"verdict": drift.verdict, **drift.evidence}
    return Finding("energy", "note", "; ".join(lines), evidence)
