"""Steppers that are right only if all nodes and all springs have the same parameters."""

from __future__ import annotations

import numpy as np

from ropeode.checking.check_context import Examination, reference_of
from ropeode.checking.diagnosis.diagnostic_ropes import uniform_rope
from ropeode.checking.diagnosis.limits import stepper_limit
from ropeode.checking.report import Diagnosis
from ropeode.problems.problem import Problem

# Factors for the parameters of nodes and of springs.
_NODES = np.array([1.2, 0.8, 0.6, 1.5, 0.9])
_SPRINGS = np.array([0.8, 1.4, 1.1, 0.7])
_DRIVE = np.array([0.9, 0.7, -1.1])
_ARRAYS = {
    "mass": ("masses", _NODES),
    "damping": ("damping coefficients", _NODES),
    "stiffness": ("stiffnesses", _SPRINGS),
    "rest_length": ("rest lengths", _SPRINGS),
}


def diagnose_heterogeneity(examination: Examination) -> Diagnosis | None:
    """Why a stepper is wrong that is right on a uniform rope without forces that depend on time.

    Returns:
        None if it is right whichever parameters differ and with such a force, or if its runs have
        no limit.
    """
    args = uniform_rope().args
    results = {
        name: _is_right(
            examination, _changed(f"different {words}", **{name: getattr(args, name) * factors})
        )
        for name, (words, factors) in _ARRAYS.items()
    }
    names = [name for name, right in results.items() if right is False]
    if names:
        words = " or ".join(_ARRAYS[name][0] for name in names)
        return Diagnosis(
            "unlike-numbers",
            f"the stepper is right if all nodes and springs are the same, and wrong if {words} "
            "differ: it uses one value for all, or reads the wrong entries of the array",
            {"right": results},
        )
    driven = _changed("uniform, driven", drive=_DRIVE, frequency=np.asarray(2.7))
    if examination.own_forces or _is_right(examination, driven) is not False:
        return None
    return Diagnosis(
        "time",
        "the stepper is right without a force that depends on time, and converges to a wrong "
        "solution if one is added: it does not evaluate forces at the time of the step",
        {"right": {**results, "drive": False}},
    )


def _changed(name: str, **args: np.ndarray) -> Problem:
    rope = uniform_rope()
    return rope.changed(args=rope.args._replace(**args), name=name)


def _is_right(examination: Examination, problem: Problem) -> bool | None:
    """Whether the runs tend to the solution; None if they have no limit."""
    limit = stepper_limit(examination, problem)
    return None if limit is None else limit.misfit(reference_of(problem)) <= 1.0
