"""Steppers that are right as long as all nodes and springs are alike."""

from __future__ import annotations

from typing import Any

import numpy as np

from ropeode.checking.candidate import Candidate
from ropeode.checking.check_context import reference_of
from ropeode.checking.diagnosis.diagnostic_ropes import alike
from ropeode.checking.diagnosis.equation import misfit_of
from ropeode.checking.diagnosis.fit import observed
from ropeode.checking.diagnosis.runs import runs_of
from ropeode.checking.report import Diagnosis
from ropeode.problems.problem import Problem

# Factors, for numbers of nodes and of springs.
_NODES = np.array([1.2, 0.8, 0.6, 1.5, 0.9])
_SPRINGS = np.array([0.8, 1.4, 1.1, 0.7])
_ARRAYS = {
    "mass": ("masses", _NODES),
    "damping": ("damping coefficients", _NODES),
    "stiffness": ("stiffnesses", _SPRINGS),
    "rest_length": ("rest lengths", _SPRINGS),
}


def wrong_where_unlike(candidate: Candidate) -> Diagnosis | None:
    """Say which numbers a stepper takes for alike, or that it takes time for standing still.

    Arguments:
        candidate: a stepper that is right on a rope whose nodes and springs are alike and whose
            forces do not depend on time.

    Returns:
        None where it is right whichever numbers differ and with a force that depends on time,
        or its runs tend to nothing.
    """
    results = {name: _is_right(candidate, _unlike(name)) for name in _ARRAYS}
    names = [name for name, right in results.items() if right is False]
    if names:
        words = " or ".join(_ARRAYS[name][0] for name in names)
        return Diagnosis(
            "unlike-numbers",
            f"it is right where all nodes and springs are alike, and wrong where {words} differ: "
            "one number is used for all, or they are taken from the wrong places of the array",
            {"right": results},
        )
    if candidate.own_forces or _is_right(candidate, _driven()) is not False:
        return None
    return Diagnosis(
        "time",
        "it is right without a force that depends on time, and converges to something else with "
        "one, on a rope that is otherwise the same: the time that forces are evaluated at is not "
        "that of the step",
        {"right": {**results, "drive": False}},
    )


def _unlike(name: str) -> Problem:
    given = alike()
    changed: dict[str, Any] = {name: getattr(given.args, name) * _ARRAYS[name][1]}
    return given.changed(args=given.args._replace(**changed), name=f"unlike {_ARRAYS[name][0]}")


def _driven() -> Problem:
    given = alike()
    drive = {"drive": np.array([0.9, 0.7, -1.1]), "frequency": np.asarray(2.7)}
    return given.changed(args=given.args._replace(**drive), name="alike, driven")


def _is_right(candidate: Candidate, problem: Problem) -> bool | None:
    """Whether the runs tend to the solution; None where they tend to nothing."""
    seen = observed(problem, runs_of(candidate, problem), problem.quantities)
    return None if seen is None else misfit_of(seen, reference_of(problem)) <= 1.0
