"""The largest step size at which small undamped oscillations do not grow."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ropeode.analysis import normal_modes
from ropeode.checking.check_context import Examination
from ropeode.checking.check_ropes import hanging
from ropeode.checking.report import Finding
from ropeode.steppers import BuiltIn
from ropeode.theory import (
    LinearisedStep,
    StabilityFunction,
    stability_function_of,
    stable_interval,
)

# In units of 1/omega: where the search begins and ends.
_SMALLEST, _LARGEST = 0.05, 8.0
_GRID = np.geomspace(_SMALLEST, _LARGEST, 24)
# Growth of a mode per step that finite differences cannot distinguish from none.
_GROWTH = 1e-6
_PRECISION = 1e-4
# The relative difference from theory that is allowed.
_AGREE = 0.01


def stability(examination: Examination) -> Finding:
    """The largest ``dt omega`` at which small undamped oscillations of a rope do not grow.

    The eigenvalues of the derivative of one step about the rope at rest are the factors by
    which modes grow (von Neumann's criterion); omega is the rope's largest frequency.
    """
    problem = hanging()
    omega = float(normal_modes(problem, problem.y0).frequencies[-1])
    step = LinearisedStep(problem, examination.method, problem.y0)
    if not step.settles:
        line = "not measured: the stepper has not settled after 16 steps, and each is another one"
        return Finding("stability", "note", line, {"limit": None})

    def largest_factor(dt: float) -> float:
        matrix = step.matrix(dt)
        finite = np.all(np.isfinite(matrix))
        return float(np.max(np.abs(np.linalg.eigvals(matrix)))) if finite else np.inf

    limit = _limit(lambda z: np.array([largest_factor(dt) for dt in z / omega]))
    line, evidence = _words(limit), {"limit": limit}
    method = examination.claims.method
    # A user's class claims its own name, which may happen to be that of another method.
    known = method != examination.stepper.label or isinstance(examination.stepper, BuiltIn)
    function = stability_function_of(problem, method) if method and known else None
    if not isinstance(function, StabilityFunction):
        return Finding("stability", "note", line, evidence)
    theory = evidence["theory"] = _limit(lambda z: function.radius(1j * z))
    agrees = abs(limit - theory) <= _AGREE * max(theory, _SMALLEST)
    line += f"; theory for {method}: {theory:.3f}"
    return Finding("stability", "pass" if agrees else "fail", line, evidence)


def _words(limit: float) -> str:
    if limit == 0.0:
        return f"unstable even at the smallest dt tried, {_SMALLEST:g}/omega"
    if limit >= _LARGEST:
        return f"stable up to the largest dt tried, {_LARGEST:g}/omega"
    return f"without damping, stable up to dt = {limit:.3f}/omega"


def _limit(radius: Callable[[np.ndarray], np.ndarray]) -> float:
    """The largest ``dt omega`` up to which no mode grows.

    It is 0 if the stepper is unstable at the smallest step tried, and 8 if it is stable at the
    largest.
    """
    return stable_interval(radius, _GRID, _GROWTH, _PRECISION).limit
