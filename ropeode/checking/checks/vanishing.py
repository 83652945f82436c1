"""Whether a defect vanishes with the step size, and how fast.

A step that makes a few sweeps of an iteration breaks symmetries by what the iteration leaves. That
is no fault where it is of higher order than the method itself: then it changes no digit of the
error as dt goes to 0.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from ropeode.checking.check_context import Examination
from ropeode.checking.checks.local_errors import exact_states
from ropeode.problems import Problem

# Steps per frame at which a defect is measured for the power of dt.
STEPS = (20, 40)
# A power that is observed between two step sizes is off by at most this.
POWER_TOLERANCE = 0.25
# By how much the power exceeds the order of a method that the defect does not harm.
_HIGHER = 0.5
# What a tolerance leaves is small beside the error if it is at most this part of it; or at most as
# large, where the error itself is so small. (Steps inside the step that adapt have no other error.)
_SMALL_PART, _ACCURATE = 0.01, 1e-4
# In place of infinity, which JSON does not have.
_AT_ONCE = 99.0


def falling_power(defect: Callable[[int], float]) -> float:
    """The power of dt with which a defect falls; negative where it grows, or is not finite.

    Arguments:
        defect: its size at a number of steps per frame.
    """
    coarse, fine = map(defect, STEPS)
    if fine == 0.0:
        return _AT_ONCE
    if not (math.isfinite(coarse) and math.isfinite(fine)) or coarse == 0.0:
        return -_AT_ONCE
    return math.log(coarse / fine) / math.log(STEPS[1] / STEPS[0])


def is_harmless(power: float, examination: Examination, problem: Problem) -> bool:
    """Whether a defect may be what an iteration leaves, and is of higher order than the method.

    Arguments:
        power: of dt, with which it falls.
        examination: of the stepper; where no order is claimed, 1 is expected.
        problem: on which it has the defect.
    """
    order = examination.expected(problem) or 1
    return examination.may_sweep and power >= order + _HIGHER


def is_small(defect: Callable[[int], float], examination: Examination, problem: Problem) -> bool:
    """Whether a defect is small beside the error of the steps, as where a tolerance ends them.

    Arguments:
        defect: its size at a number of steps per frame, as a part of the rope's.
        examination: of the stepper.
        problem: on which it has the defect; a rope without a drive.
    """
    states = examination.run(problem, STEPS[1])
    error = float(np.max(np.abs(states - exact_states(problem)))) / problem.scale
    most = error if error <= _ACCURATE else _SMALL_PART * error
    return examination.may_sweep and defect(STEPS[1]) <= most < math.inf


def cut_off(power: float) -> str:
    """How a defect of higher order falls, in words after `and by`."""
    return f"dt^{power:.1f} less at smaller dt, as where an iteration is cut off"
