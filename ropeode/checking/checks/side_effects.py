"""Side effects of a step, and the first sample of a run."""

from __future__ import annotations

import numpy as np

from ropeode.checking.check_context import Examination
from ropeode.checking.check_ropes import generic
from ropeode.checking.report import Finding
from ropeode.simulation import step_size
from ropeode.simulation.step_map import StepMap

# Steps per frame: so many, that a step which counts its calls has counted to a hundred.
_STEPS = 48
# Units of rounding by which the first sample may differ from the initial state.
_ROUNDINGS = 4.0


def determinism(examination: Examination) -> Finding:
    """Two runs of the same problem give the same result to the last bit.

    `check_stepper` has compared single steps before.
    """
    check = "determinism"
    first, again = (examination.candidate.run(generic(), _STEPS) for _ in range(2))
    if not np.array_equal(first, again, equal_nan=True):
        difference = float(np.nanmax(np.abs(first - again)))
        line = f"not deterministic: two runs of the same problem differ by {difference:.1e}"
        return Finding(check, "fail", line, {"difference": difference})
    return Finding(check, "pass", "deterministic: repeated runs are identical to the last bit")


def purity(examination: Examination) -> Finding:
    """A step does not modify its arguments."""
    check, mutated = "purity", examination.candidate.method.trial.writes_to
    if mutated:
        names = " and ".join(mutated)
        return Finding(
            check,
            "fail",
            f"the step modifies its arguments ({names}); write x = x + dt * v instead of "
            "x += dt * v, which changes the caller's array",
            {"mutates": list(mutated)},
        )
    return Finding(check, "pass", "the step does not modify its arguments")


def first_sample(examination: Examination) -> Finding:
    """The first sample is the initial state."""
    problem = generic()
    dt = step_size(problem, _STEPS)
    first = StepMap(problem, examination.candidate.method).first_sample(problem.y0, dt)
    off = np.abs(first - problem.y0)
    # A two-step method takes its velocities from differences, which are as good as its order.
    largest = float(np.max(off[0] if examination.candidate.stepper.equal_frames else off))
    rounding = _ROUNDINGS * np.finfo(np.float64).eps * problem.scale
    if not largest <= rounding:
        return Finding(
            "first-sample",
            "fail",
            f"the first sample is not the initial state: it is off by {largest:.1e}",
            {"difference": largest},
        )
    exactly = "exactly" if largest == 0.0 else f"to rounding ({largest:.1e})"
    return Finding("first-sample", "pass", f"the first sample is the initial state {exactly}")
