"""Steppers that are right only if all nodes and all springs have the same parameters."""

from __future__ import annotations

from typing import Any

import numpy as np

from ropeode.checking.candidate import Candidate
from ropeode.checking.check_context import reference_of
from ropeode.checking.diagnosis.diagnostic_ropes import uniform_rope
from ropeode.checking.diagnosis.limits import observe_limit, runs_of
from ropeode.checking.report import Diagnosis
from ropeode.problems.problem import Problem

# Factors for the parameters of nodes and of springs.
_NODES = np.array([1.2, 0.8, 0.6, 1.5, 0.9])
_SPRINGS = np.array([0.8, 1.4, 1.1, 0.7])
_ARRAYS = {
    "mass": ("masses", _NODES),
    "damping": ("damping coefficients", _NODES),
    "stiffness": ("stiffnesses", _SPRINGS),
    "rest_length": ("rest lengths", _SPRINGS),
}


def diagnose_heterogeneity(candidate: Candidate) -> Diagnosis | None:
    """Find the parameters that make a stepper wrong where they differ, or whether time does.

    Arguments:
        candidate: a stepper that is right on a rope whose nodes and springs are all the same and
            whose forces do not depend on time.

    Returns:
        None if it is right whichever parameters differ and with a force that depends on time,
        or if its runs have no limit.
    """
    results = {name: _is_right(candidate, _heterogeneous(name)) for name in _ARRAYS}
    names = [name for name, right in results.items() if right is False]
    if names:
        words = " or ".join(_ARRAYS[name][0] for name in names)
        return Diagnosis(
            "unlike-numbers",
            f"the stepper is right if all nodes and springs are the same, and wrong if {words} "
            "differ: it uses one value for all, or reads the wrong entries of the array",
            {"right": results},
        )
    if candidate.own_forces or _is_right(candidate, _driven()) is not False:
        return None
    return Diagnosis(
        "time",
        "the stepper is right without a force that depends on time, and converges to a wrong "
        "solution if one is added: it does not evaluate forces at the time of the step",
        {"right": {**results, "drive": False}},
    )


def _heterogeneous(name: str) -> Problem:
    rope, (words, factors) = uniform_rope(), _ARRAYS[name]
    changed: dict[str, Any] = {name: getattr(rope.args, name) * factors}
    return rope.changed(args=rope.args._replace(**changed), name=f"different {words}")


def _driven() -> Problem:
    rope = uniform_rope()
    drive = {"drive": np.array([0.9, 0.7, -1.1]), "frequency": np.asarray(2.7)}
    return rope.changed(args=rope.args._replace(**drive), name="uniform, driven")


def _is_right(candidate: Candidate, problem: Problem) -> bool | None:
    """Whether the runs tend to the solution; None if they have no limit."""
    limit = observe_limit(problem, runs_of(candidate, problem), problem.quantities)
    return None if limit is None else limit.misfit(reference_of(problem)) <= 1.0
