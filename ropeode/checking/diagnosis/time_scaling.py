"""Steppers that solve the right equations with time running too fast or too slowly."""

from __future__ import annotations

import numpy as np
from scipy import integrate, optimize

from ropeode.checking.check_context import Examination, reference_of
from ropeode.checking.diagnosis.diagnostic_ropes import (
    uniform_rope,
    uniform_rope_with_other_start,
)
from ropeode.checking.diagnosis.fitted_numbers import shortest
from ropeode.checking.diagnosis.limits import ObservedLimit, stepper_limit
from ropeode.checking.report import Diagnosis
from ropeode.errors import ReferenceRefused
from ropeode.problems.problem import Problem
from ropeode.references.reference import Reference
from ropeode.simulation.system import system

# The range of factors, and the tolerance of the solution that they are fitted to.
_SLOWEST, _FASTEST = 0.2, 5.0
_TOLERANCE = 1e-12


def diagnose_time_scaling(examination: Examination) -> Diagnosis | None:
    """Test whether runs tend to the solution with time multiplied by a factor.

    Without a force that depends on time, ``y' = s f(y)`` has the solution ``y(s t)``. A step
    that changes positions and velocities by s times the right amount solves this equation.

    Returns:
        None if no factor explains the limits of its runs on two ropes.
    """
    first, second = (
        stepper_limit(examination, problem)
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
    problem, shape = limit.problem, limit.problem.y0.shape
    own = system(problem.rhs, problem.mechanics, problem.args, in_numpy=True)
    elapsed, rhs = problem.ts - problem.ts[0], own.equations.rhs
    solution = integrate.solve_ivp(
        lambda t, y: np.ravel(rhs(problem.ts[0], y.reshape(shape), problem.args)),
        (0.0, _FASTEST * elapsed[-1]),
        problem.y0.ravel(),
        method="DOP853",
        dense_output=True,
        rtol=_TOLERANCE,
        atol=_TOLERANCE * problem.scale,
    ).sol

    def error(factor: np.ndarray) -> np.ndarray:
        states = solution(factor[0] * elapsed).T.reshape(limit.states.shape)
        return ((limit.states - states) / limit.uncertainty)[1:].ravel()

    fit = optimize.least_squares(
        error, 1.0, bounds=(_SLOWEST, _FASTEST), xtol=_TOLERANCE, ftol=_TOLERANCE
    )
    slope = fit.jac[:, 0]
    return float(fit.x[0]), float(np.sum(np.abs(slope)) / (slope @ slope))
