"""Side effects of a step, and the first sample of a run."""

from __future__ import annotations

import functools
import time

import jax
import numpy as np

from ropeode.checking.check_context import Examination
from ropeode.checking.check_ropes import generic
from ropeode.checking.report import Finding, exactly, passed_if
from ropeode.simulation import (
    HIDDEN_STATE,
    PythonStepper,
    StepMap,
    on_user_clock,
    one_at_a_time,
    step_size,
    user_time_left,
)

# Steps per frame: so many, that a step which counts its calls has counted to a hundred.
_STEPS = 48
# How often one step is made again, and the processor time of all; other threads make references.
_CALLS, _SECONDS = 12_000, 3.0
# Its length: together they last longer than any run.
_DT = 0.01
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
    calls, same = _repeated(examination)
    if not same:
        line = f"{HIDDEN_STATE}: the same step gives another result when it is made {calls} times"
        return Finding("determinism", "fail", line, {"calls": calls})
    line = "deterministic: repeated runs are identical to the last bit"
    if calls:
        line += f", and so is a step that is made {calls} times"
    return Finding("determinism", "pass", line)


def _repeated(examination: Examination) -> tuple[int, bool]:
    """How often the same step was made, in Python, and whether it always gave the same.

    Not made at all, if the step cannot count: nothing that it might remember has changed.
    """
    stepper, problem, trial = examination.stepper, generic(), examination.method.trial
    if not (trial.remembers or trial.side_effects):
        return 0, True
    own = PythonStepper(problem, stepper)
    t = float(problem.ts[0])
    # A time limit that is shorter must not be reached by what is only repeated.
    ends_at = time.thread_time() + min(_SECONDS, user_time_left() / 2.0)

    def steps() -> tuple[int, bool]:
        carried = own.init(t, problem.y0, _DT)
        first = None
        for call in range(1, _CALLS + 1):
            # It may write to what it is handed.
            given = jax.tree.map(lambda leaf: np.array(leaf, order="C"), carried)
            result = [np.array(each) for each in jax.tree.leaves(own.step(t, given, _DT))]
            first = first or result
            if not all(map(functools.partial(np.array_equal, equal_nan=True), first, result)):
                return call, False
            # One that compiles something anew at each call fills the process up with programs.
            if time.thread_time() > ends_at:
                break
        return call, True

    with one_at_a_time(), np.errstate(all="ignore"):
        return on_user_clock(steps)


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
