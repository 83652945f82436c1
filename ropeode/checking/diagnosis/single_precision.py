"""Numbers that are rounded to float32 on their way."""

from __future__ import annotations

import numpy as np

from ropeode.checking.candidate import Candidate
from ropeode.checking.diagnosis.diagnostic_ropes import in_units_of_1024
from ropeode.checking.problems import generic
from ropeode.checking.report import Diagnosis
from ropeode.problems.problem import Problem

_STEPS = 4
_NUDGES = 8
# Changes of the initial state: as small as float32's own rounding, so that some are rounded up
# and some down, and far above it.
_SMALL, _LARGE = 3e-8, 1e-3
# Of the rope's size: how far the response to small changes is off a straight line, where it is
# rounded to 24 bits, or where a part of a step is that is small beside the whole.
_LEAST, _MOST = 1e-11, 1e-6
_SMOOTH = 0.05


def single_precision(candidate: Candidate) -> Diagnosis | None:
    """Say so if a stepper answers tiny changes in jumps of the size of float32's rounding.

    It must answer larger changes smoothly, and in a unit of length that is 1024 times as
    small make the same to the last bit: this is so for binary numbers of any length, and
    not for what is rounded to decimals or is not smooth in itself.

    Arguments:
        candidate: the stepper.
    """
    problem = generic()
    own = candidate.run(problem, _STEPS)
    jumps = _jumps(candidate, problem, _SMALL)
    unsmooth = _jumps(candidate, problem, _LARGE) / _LARGE
    binary = np.array_equal(candidate.run(in_units_of_1024(problem), _STEPS), 1024.0 * own)
    if not (_LEAST <= jumps <= _MOST and unsmooth <= _SMOOTH and binary):
        return None
    free = own[1:][:, :, problem.args.free > 0]
    stored = bool(np.array_equal(free, free.astype(np.float32)))
    where = "the states are" if stored else "something that a step computes is"
    return Diagnosis(
        "float32",
        f"{where} rounded to float32: changes of {_SMALL:.0e} are answered in jumps of "
        f"{jumps:.1e} of the rope's size, where float64 has 1e-16; convert nothing to float32",
        {"jumps": jumps, "states_are_float32": stored, "nonlinearity_of_large_changes": unsmooth},
    )


def _jumps(candidate: Candidate, problem: Problem, size: float) -> float:
    """How far the response to changes in one direction is off a straight line, of the size."""
    direction = np.random.default_rng(5).normal(size=problem.y0.shape)
    direction *= problem.args.free[None, :, None]
    factors = np.arange(_NUDGES) / (_NUDGES - 1.0)
    runs = np.stack(
        [
            candidate.run(problem.changed(y0=problem.y0 + k * size * direction), _STEPS)
            for k in factors
        ]
    )
    straight = runs[0] + factors.reshape(-1, 1, 1, 1, 1) * (runs[-1] - runs[0])
    return float(np.max(np.abs(runs - straight))) / problem.scale
