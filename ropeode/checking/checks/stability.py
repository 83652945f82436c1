"""The largest step size at which small undamped oscillations do not grow."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ropeode.analysis import frequencies
from ropeode.checking.check_context import Examination
from ropeode.checking.check_ropes import hanging
from ropeode.checking.report import Finding
from ropeode.simulation import StepMap
from ropeode.steppers import BuiltIn
from ropeode.theory import StabilityFunction, stability_function_of, stable_interval

# In units of 1/omega: where the search begins and ends.
_SMALLEST, _LARGEST = 0.05, 8.0
_GRID = np.geomspace(_SMALLEST, _LARGEST, 24)
# Growth of a mode per step that finite differences cannot distinguish from none.
_GROWTH = 1e-6
_PRECISION = 1e-4
# The relative difference from theory that is allowed.
_AGREE = 0.01


def stability(examination: Examination) -> Finding:
    """The largest ``dt omega`` at which small undamped oscillations do not grow."""
    growth = _growth_on_the_rope(examination)
    if growth is None:
        line = "not measured: the stepper has not settled after 16 steps, and each is another one"
        return Finding("stability", "note", line, {"limit": None})
    limit = _limit(growth)
    evidence = {"limit": limit}
    line = _words(limit)
    method = examination.claims.method
    # A user's class claims its own name, which may happen to be that of another method.
    known = method != examination.stepper.label or isinstance(examination.stepper, BuiltIn)
    theory = _in_theory(method) if method and known else None
    if theory is None:
        return Finding("stability", "note", line, evidence)
    evidence["theory"] = theory
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


def _in_theory(method: str) -> float | None:
    """The limit of a known method, from its stability function; None if it has none."""
    function = stability_function_of(hanging(), method)
    if not isinstance(function, StabilityFunction):
        return None
    return _limit(lambda z: function.radius(1j * z))


def _growth_on_the_rope(examination: Examination) -> Callable[[np.ndarray], np.ndarray] | None:
    """The largest factor of all modes of a hanging rope, against ``dt omega``.

    None where there is none, since each step is another one.

    The eigenvalues of the derivative of one step about the rope at rest are the factors by
    which modes grow (von Neumann's criterion); omega is the rope's largest frequency.
    """
    problem = hanging()
    one_step = StepMap(problem, examination.method)
    omega = float(frequencies(problem, problem.y0)[-1])
    free = np.broadcast_to((problem.args.free > 0.0)[:, None], problem.y0.shape[1:])
    begin = one_step.beginning(problem.y0, _SMALLEST / omega, free)
    if begin is None:
        return None

    def largest_factor(dt: float) -> float:
        """The spectral radius of one step, over the movable part of what the stepper carries."""
        carried = one_step.start(problem.y0, dt, begin)
        matrix = one_step.derivative(carried, dt, one_step.moving(carried, free))
        if not np.all(np.isfinite(matrix)):
            return np.inf
        return float(np.max(np.abs(np.linalg.eigvals(matrix))))

    return lambda z: np.array([largest_factor(dt) for dt in z / omega])
