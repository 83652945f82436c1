"""What a motion conserves: the places of pinned nodes, momentum, energy."""

from __future__ import annotations

import numpy as np

from ropeode.checking.check_context import Examination
from ropeode.checking.check_ropes import convergence_problems, held, swing
from ropeode.checking.checks.vanishing import judged
from ropeode.checking.energy_drift import measure_drift
from ropeode.checking.report import Finding, as_claimed, exactly, passed_if

_STEPS = 16
# Pinned nodes move by rounding at most, as a part of the rope's size.
_PIN_TOLERANCE = 1e-13
# Nodes that hold the rope, beside the one of the check rope.
_HELD = ((0, 4), (4,), (0, 2, 3))
# Step sizes of free flight, and the rounding of differences over such steps.
_FLIGHTS = (1e-3, 0.02, 0.3, 10.0)
# Springs so weak move nothing by a rounding in the longest flight. They are not left out, for a
# step may rightly divide by the stiffness, as with compliant constraints.
_WEAK = 2.0**-60
_FLIGHT_TOLERANCE = 1e-11
# As a part of the sum of the nodes' momenta.
_MOMENTUM_TOLERANCE = 1e-11
# Steps in half a time unit; the fastest mode of the swing then turns by 0.4 in a step.
_ENERGY_STEPS = 8


def free_flight(examination: Examination) -> Finding:
    """Nodes on which no force acts move by ``dt v`` in a step, however long that is.

    Every consistent method does so exactly. The check finds steps that use another dt than the
    caller's, and friction that the problem does not have.
    """
    problem = convergence_problems()["free"]
    weak = problem.args._replace(stiffness=np.full_like(problem.args.stiffness, _WEAK))
    x0, v0 = problem.y0
    worst, at = 0.0, 0.0
    for dt in _FLIGHTS:
        x, v = examination.one_step(problem.changed(args=weak), dt)
        off = max(np.max(np.abs(x - x0 - dt * v0)) / (1.0 + dt), np.max(np.abs(v - v0)))
        if not off <= worst:
            worst, at = float(off), dt
    return passed_if(
        worst <= _FLIGHT_TOLERANCE * problem.scale,
        "free-flight",
        f"a node without forces moves by dt v, to within {worst:.1e}, for dt from 0.001 to 10",
        f"a node without forces does not move by dt v: off by {worst:.1e} at dt = {at:g}",
        off=worst,
        dt=at,
    )


def pins(examination: Examination) -> Finding:
    """Pinned nodes do not move, whichever and however many they are."""
    own = convergence_problems()["unequal"]
    worst, which = 0.0, ""
    for problem in (own, *(held(own, *nodes) for nodes in _HELD)):
        states = examination.run(problem, _STEPS)
        pinned = problem.args.free == 0.0
        moved = float(np.max(np.abs(states - problem.y0)[:, :, pinned])) / problem.scale
        if not moved <= worst:
            worst, which = moved, ", ".join(str(node) for node in np.flatnonzero(pinned))
    return passed_if(
        worst <= _PIN_TOLERANCE,
        "pins",
        f"pinned nodes stay in place {exactly(worst)}",
        f"a pinned node moves by {worst:.1e} of the rope's size (node {which} is pinned)"
        if "," not in which
        else f"a pinned node moves by {worst:.1e} of the rope's size (nodes {which} are pinned)",
        moved=worst,
    )


def momentum(examination: Examination) -> Finding:
    """The momentum of a rope without pins and gravity is constant.

    Every method that treats all nodes alike keeps it to rounding, and so does one that works off
    springs one after the other. An iteration that has not ended leaves a defect; that of a
    legitimate one is of higher order than the method.
    """
    problem = convergence_problems()["free"]

    def change(steps: int) -> float:
        """As a part of the sum of the nodes' momenta."""
        states = examination.run(problem, steps)
        each = problem.args.mass[:, None] * states[:, 1]
        total = np.sum(each, axis=1)
        size = float(np.max(np.sum(np.abs(each), axis=1)))
        return float(np.max(np.abs(total - total[0]))) / size

    return judged(
        "momentum",
        examination,
        problem,
        change,
        steps=_STEPS,
        allowed=_MOMENTUM_TOLERANCE,
        good="the momentum of a free rope is constant to {}",
        bad="the momentum of a free rope changes by {} of the nodes' momenta",
        evidence="changed",
    )


def energy(examination: Examination) -> Finding:
    """Whether the energy of an undamped rope is bounded, drifts or grows in a long run."""
    problem = swing()
    drift = measure_drift(problem, examination.run(problem, _ENERGY_STEPS))
    bounded = drift.verdict == "bounded"
    claimed = examination.conserves_energy
    return as_claimed(claimed, bounded, "energy", "stay bounded", drift.line, **drift.evidence)
