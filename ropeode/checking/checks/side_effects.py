"""How a step behaves, apart from what it computes."""

from __future__ import annotations

import numpy as np

from ropeode.checking.check_context import Examination
from ropeode.checking.problems import generic
from ropeode.checking.report import Finding
from ropeode.simulation import step_size
from ropeode.simulation.step_map import StepMap

# Steps per frame: so many, that a step which counts its calls has counted to a hundred.
_STEPS = 48
# Units of rounding by which the first sample may differ from the initial state.
_ROUNDINGS = 4.0


def determinism(examination: Examination) -> Finding:
    """The same input gives the same output, in one step and in a run, to the last bit."""
    check = "determinism"
    if not examination.candidate.method.trial.repeatable:
        return Finding(
            check,
            "fail",
            "the same step, made again, gives another result: it keeps something from call to "
            "call, or draws random numbers (a method that remembers needs a Stepper with `init`)",
        )
    first, again = (examination.candidate.run(generic(), _STEPS) for _ in range(2))
    if not np.array_equal(first, again, equal_nan=True):
        apart = float(np.nanmax(np.abs(first - again)))
        line = f"two runs of the same problem differ, by {apart:.1e}"
        return Finding(check, "fail", line, {"difference": apart})
    return Finding(check, "pass", "runs repeat to the last bit")


def purity(examination: Examination) -> Finding:
    """A step writes to nothing that it is given."""
    check, mutated = "purity", examination.candidate.method.trial.writes_to
    if mutated:
        names = " and ".join(mutated)
        return Finding(
            check,
            "fail",
            f"a step writes to what it is given ({names}); make a copy, as in x = x + dt * v "
            "in place of x += dt * v",
            {"mutates": list(mutated)},
        )
    return Finding(check, "pass", "a step leaves what it is given as it is")


def first_sample(examination: Examination) -> Finding:
    """The first sample is the initial state."""
    problem = generic()
    dt = step_size(problem, _STEPS)
    first = StepMap(problem, examination.candidate.method).first_sample(problem.y0, dt)
    off = np.abs(first - problem.y0)
    # A two-step method takes its velocities from differences, which are as good as its order.
    apart = float(np.max(off[0] if examination.candidate.stepper.equal_frames else off))
    rounding = _ROUNDINGS * np.finfo(np.float64).eps * problem.scale
    if not apart <= rounding:
        return Finding(
            "first-sample",
            "fail",
            f"the first sample is not the initial state, but {apart:.1e} off it",
            {"difference": apart},
        )
    exact = "to the last bit" if apart == 0.0 else f"to rounding ({apart:.1e})"
    return Finding("first-sample", "pass", f"the first sample is the initial state, {exact}")
