"""Side effects of a step, and the first sample of a run."""

from __future__ import annotations

import numpy as np

from ropeode.checking.check_context import Examination
from ropeode.checking.check_ropes import generic
from ropeode.checking.report import Finding, exactly, passed_if
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
    first, again = (examination.run(generic(), _STEPS) for _ in range(2))
    if not np.array_equal(first, again, equal_nan=True):
        difference = float(np.nanmax(np.abs(first - again)))
        line = f"not deterministic: two runs of the same problem differ by {difference:.1e}"
        return Finding("determinism", "fail", line, {"difference": difference})
    return Finding(
        "determinism", "pass", "deterministic: repeated runs are identical to the last bit"
    )


def purity(examination: Examination) -> Finding:
    """A step returns a result, and does nothing else that anybody could notice."""
    found = examination.method.trial.side_effects
    if not found:
        line = "the step modifies neither its arguments, nor earlier results, nor its process"
        return Finding("purity", "pass", line)
    line = f"the step {' and '.join(found)}"
    if any(each.startswith("modifies") for each in found):
        line += "; write x = x + dt * v instead of x += dt * v, which changes the caller's array"
    return Finding("purity", "fail", line, {"side_effects": list(found)})


def first_sample(examination: Examination) -> Finding:
    """The first sample is the initial state."""
    problem = generic()
    dt = step_size(problem, _STEPS)
    first = StepMap(problem, examination.method).first_sample(problem.y0, dt)
    off = np.abs(first - problem.y0)
    # A two-step method takes its velocities from differences, which are as good as its order.
    largest = float(np.max(off[0] if examination.stepper.equal_frames else off))
    return passed_if(
        largest <= _ROUNDINGS * np.finfo(np.float64).eps * problem.scale,
        "first-sample",
        f"the first sample is the initial state {exactly(largest)}",
        f"the first sample is not the initial state: it is off by {largest:.1e}",
        difference=largest,
    )
