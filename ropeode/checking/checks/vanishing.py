"""Whether a defect vanishes with the step size, and how fast.

A step that makes a few sweeps of an iteration breaks symmetries by what the iteration leaves. That
is no fault where it is of higher order than the method itself: then it changes no digit of the
error as dt goes to 0. Nor is what a tolerance leaves, of an iteration or of steps inside the step,
where it is small beside the error of the step: the tolerance has a unit, or is a part of a number
that another motion adds to.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Any

import numpy as np

from ropeode.checking.check_context import Examination, reference_of
from ropeode.checking.report import Finding
from ropeode.problems import Problem
from ropeode.simulation import step_size

# Steps per frame at which a defect is measured for the power of dt.
_STEPS = (20, 40)
# A power that is observed between two step sizes is off by at most this.
_POWER_TOLERANCE = 0.25
# By how much the power exceeds the order of a method that the defect does not harm.
_HIGHER = 0.5
# What a tolerance leaves is small beside the error if it is at most this part of it; or at most as
# large, where the error itself is so small. (Steps inside the step that adapt have no other error.)
_SMALL_PART, _ACCURATE = 0.01, 1e-4
# In place of infinity, which JSON does not have.
_AT_ONCE = 99.0


def judged(
    check: str,
    examination: Examination,
    problem: Problem,
    defect: Callable[[int], float],
    *,
    steps: int,
    allowed: float,
    good: str,
    bad: str,
    evidence: str,
    hint: str = "",
    sweeps: bool = False,
) -> Finding:
    """Whether a right step may leave a defect.

    Arguments:
        check: its name.
        examination: of the stepper.
        problem: on which it has the defect; a rope without a drive.
        defect: how large it is at a number of steps per frame, as a part of the rope's size.
        steps: per frame, at which it is told.
        allowed: what rounding may leave.
        good: the result in words, if it is no more, with `{}` for the defect.
        bad: likewise, if it is more.
        evidence: what the defect is called there.
        hint: where to look for the cause.
        sweeps: whether it may be of the order of the method, as where a step works off nodes one
            after the other. No method that is claimed by name does.
    """
    defect = functools.cache(defect)
    found = defect(steps)
    if found <= allowed:
        return Finding(check, "pass", good.format(f"{found:.1e}"), {evidence: found})
    power = _falling_power(defect)
    numbers: dict[str, Any] = {evidence: found, "power": power}
    bad = bad.format(f"{found:.1e}")
    # Where no order is claimed, 1 is expected.
    order = examination.expected(problem) or 1
    less = f"and by dt^{power:.1f} less at smaller dt"
    why = ""
    if power >= order + _HIGHER:
        why = f"{less}, as where an iteration is cut off"
    elif _is_small(defect, examination, problem):
        why = "which is small beside the error of the step, as where a tolerance ends it"
    elif sweeps and power >= order - _POWER_TOLERANCE:
        why = f"{less}: it sweeps over nodes or springs"
    if not why or not examination.may_sweep:
        return Finding(check, "fail", bad + hint, numbers)
    line = f"{bad} at dt = {step_size(problem, steps):.3g}, {why}"
    return Finding(check, "pass", line, numbers)


def _falling_power(defect: Callable[[int], float]) -> float:
    """The power of dt with which a defect falls; negative where it grows, or is not finite."""
    coarse, fine = map(defect, _STEPS)
    if fine == 0.0:
        return _AT_ONCE
    if not (math.isfinite(coarse) and math.isfinite(fine)) or coarse == 0.0:
        return -_AT_ONCE
    return math.log(coarse / fine) / math.log(_STEPS[1] / _STEPS[0])


def _is_small(defect: Callable[[int], float], examination: Examination, problem: Problem) -> bool:
    """Whether a defect is small beside the error of the steps."""
    states = examination.run(problem, _STEPS[1])
    error = float(np.max(np.abs(states - reference_of(problem).states))) / problem.scale
    most = error if error <= _ACCURATE else _SMALL_PART * error
    return defect(_STEPS[1]) <= most < math.inf
