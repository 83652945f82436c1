"""Steppers that solve the right equations with time running too fast or too slowly."""

from __future__ import annotations

import numpy as np

from ropeode.analysis.errors import differences
from ropeode.checking.candidate import Candidate
from ropeode.checking.check_context import reference_of
from ropeode.checking.diagnosis.diagnostic_ropes import (
    uniform_rope,
    uniform_rope_with_other_start,
)
from ropeode.checking.diagnosis.fitted_numbers import shortest
from ropeode.checking.diagnosis.limits import ObservedLimit, observe_limit, runs_of
from ropeode.checking.report import Diagnosis
from ropeode.errors import ReferenceRefused
from ropeode.problems.problem import Problem
from ropeode.references.reference import Reference
from ropeode.simulation.system import system

# Gauss-Newton: iterations, and the range of factors.
_MOST_ITERATIONS = 8
_SLOWEST, _FASTEST = 0.2, 5.0
# Iterations end when the factor changes by less than this part of its spread.
_SETTLED = 1e-2


def diagnose_time_scaling(candidate: Candidate) -> Diagnosis | None:
    """Test whether runs tend to the solution with time multiplied by a factor.

    Without a force that depends on time, ``y' = s f(y)`` has the solution ``y(s t)``. A step
    that changes positions and velocities by s times the right amount solves this equation.

    Arguments:
        candidate: the stepper.

    Returns:
        None if no factor explains the limits of its runs on two ropes.
    """
    first, second = (
        observe_limit(problem, runs_of(candidate, problem), problem.quantities)
        for problem in (uniform_rope(), uniform_rope_with_other_start())
    )
    if first is None or second is None or first.stands_still(reference_of(uniform_rope())):
        return None
    try:
        factor, spread = _fit_factor(first)
        factor = shortest(factor, spread)
        misfits = [limit.misfit(_accelerated(limit.problem, factor)) for limit in (first, second)]
    except ReferenceRefused:
        return None
    if abs(factor - 1.0) <= spread or max(misfits) > 1.0:
        return None
    return Diagnosis(
        "pace",
        f"time runs {factor:.4g} times as fast as it should: in each step positions and "
        f"velocities both change by {factor:.4g} times the right amount, as if the weights of the "
        "method added up to this factor, or the step used a wrong dt",
        {"pace": factor, "spread": spread, "misfits": misfits},
    )


def _accelerated(problem: Problem, factor: float) -> Reference:
    """The certified solution at times multiplied by a factor."""
    start = problem.ts[0]
    return reference_of(problem.changed(ts=start + factor * (problem.ts - start)))


def _fit_factor(limit: ObservedLimit) -> tuple[float, float]:
    """The factor that comes closest to a limit, and how far it may be off."""
    problem, factor, spread = limit.problem, 1.0, np.inf
    own = system(problem.rhs, problem.mechanics, problem.args, in_numpy=True)
    rhs = own.equations.rhs
    elapsed = problem.ts - problem.ts[0]
    for _ in range(_MOST_ITERATIONS):
        reference = _accelerated(problem, factor)
        if reference.trusted < len(limit.states):
            break
        slopes = np.stack(
            [
                time * rhs(problem.ts[0], y, problem.args)
                for time, y in zip(elapsed, reference.states, strict=True)
            ]
        )
        slope = (slopes / limit.uncertainty)[1:].ravel()
        error = (differences(limit.states, reference) / limit.uncertainty)[1:].ravel()
        spread = float(np.sum(np.abs(slope)) / (slope @ slope))
        change = float(slope @ error / (slope @ slope))
        factor = float(np.clip(factor + change, _SLOWEST, _FASTEST))
        if abs(change) <= _SETTLED * spread:
            break
    return factor, spread
