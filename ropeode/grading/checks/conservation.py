"""What stays: pinned nodes, momentum, energy."""

from __future__ import annotations

import numpy as np

from ropeode.grading.drift import drift_of
from ropeode.grading.examination import Examination
from ropeode.grading.problems import convergence_problems, swing
from ropeode.grading.report import Finding

_STEPS = 16
# Of the size of the rope: pinned nodes move by rounding at most.
_STILL = 1e-13
# Of the sum of the nodes' momenta.
_CONSERVED = 1e-11
# Steps in half a time unit; the fastest mode of the swing then turns by 0.4 in a step.
_ENERGY_STEPS = 8


def pins(examination: Examination) -> Finding:
    """Pinned nodes do not move."""
    problem = convergence_problems()["unequal"]
    states = examination.candidate.run(problem, _STEPS)
    pinned = problem.args.free == 0.0
    moved = float(np.max(np.abs(states - problem.y0)[:, :, pinned])) / problem.scale
    if not moved <= _STILL:
        line = f"a pinned node moves, by {moved:.1e} of the rope's size"
        return Finding("pins", "fail", line, {"moved": moved})
    exactly = "to the last bit" if moved == 0.0 else f"to rounding ({moved:.1e})"
    return Finding("pins", "pass", f"pinned nodes keep still {exactly}", {"moved": moved})


def momentum(examination: Examination) -> Finding:
    """Nothing changes the momentum of a rope that is not held and feels no gravity."""
    problem = convergence_problems()["free"]
    states = examination.candidate.run(problem, _STEPS)
    each = problem.args.mass[:, None] * states[:, 1]
    total = np.sum(each, axis=1)
    size = float(np.max(np.sum(np.abs(each), axis=1)))
    changed = float(np.max(np.abs(total - total[0]))) / size
    if not changed <= _CONSERVED:
        line = f"momentum of a free rope changes, by {changed:.1e} of the nodes' momenta"
        return Finding("momentum", "fail", line, {"changed": changed})
    line = f"momentum of a free rope is kept to {changed:.1e}"
    return Finding("momentum", "pass", line, {"changed": changed})


def energy(examination: Examination) -> Finding:
    """What becomes of the energy of an undamped rope in the long run."""
    problem = swing()
    found = drift_of(problem, examination.candidate.run(problem, _ENERGY_STEPS))
    claimed = examination.conserves_energy
    if claimed is None:
        return Finding("energy", "note", found.line, found.evidence)
    if claimed == (found.verdict == "bounded"):
        return Finding("energy", "pass", found.line, found.evidence)
    claim = "it is claimed to stay bounded" if claimed else "it is claimed not to"
    return Finding("energy", "fail", f"{found.line}; {claim}", found.evidence)
