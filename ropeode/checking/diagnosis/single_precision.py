"""Numbers that a step rounds to float32."""

from __future__ import annotations

import numpy as np

from ropeode.checking.check_context import Examination
from ropeode.checking.check_ropes import generic, in_other_units
from ropeode.checking.report import Diagnosis
from ropeode.problems.problem import Problem

_STEPS = 4
_NUDGES = 8
# Changes of the initial state: as small as float32's rounding, so that some are rounded up and
# some down; and far larger.
_SMALL, _LARGE = 3e-8, 1e-3
# How far the response to small changes is off a straight line, as a part of the rope's size, if
# states are rounded to 24 bits, or only a small part of a step is.
_LEAST, _MOST = 1e-11, 1e-6
_SMOOTH = 0.05
# A power of two changes no digit of a binary number, whether it has 24 or 53 bits.
_UNITS = 1024.0


def diagnose_single_precision(examination: Examination) -> Diagnosis | None:
    """Test whether a stepper responds to tiny changes in jumps of the size of float32's rounding.

    It must respond to larger changes smoothly, and give the same result to the last bit if
    lengths are measured in a unit 1024 times smaller. Binary rounding does; rounding to
    decimals, or a step that is not smooth, does not.
    """
    problem = generic()
    own = examination.run(problem, _STEPS)
    jumps = _jumps(examination, problem, _SMALL)
    unsmooth = _jumps(examination, problem, _LARGE) / _LARGE
    scaled = examination.run(in_other_units(problem, _UNITS), _STEPS)
    binary = np.array_equal(scaled, _UNITS * own)
    if not (_LEAST <= jumps <= _MOST and unsmooth <= _SMOOTH and binary):
        return None
    free = own[1:][:, :, problem.args.free > 0]
    stored = bool(np.array_equal(free, free.astype(np.float32)))
    where = "states are" if stored else "a number inside the step is"
    return Diagnosis(
        "float32",
        f"{where} rounded to float32: the result responds to changes of {_SMALL:.0e} in jumps of "
        f"{jumps:.1e} of the rope's size (float64: 1e-16); convert nothing to float32",
        {"jumps": jumps, "states_are_float32": stored, "nonlinearity_of_large_changes": unsmooth},
    )


def _jumps(examination: Examination, problem: Problem, size: float) -> float:
    """How far the response to changes in one direction is off a straight line."""
    direction = np.random.default_rng(5).normal(size=problem.y0.shape)
    direction *= problem.args.free[None, :, None]
    factors = np.arange(_NUDGES) / (_NUDGES - 1.0)
    runs = np.stack(
        [
            examination.run(problem.changed(y0=problem.y0 + k * size * direction), _STEPS)
            for k in factors
        ]
    )
    straight = runs[0] + factors.reshape(-1, 1, 1, 1, 1) * (runs[-1] - runs[0])
    return float(np.max(np.abs(runs - straight))) / problem.scale
