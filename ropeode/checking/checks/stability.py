"""The largest step size at which small undamped oscillations do not grow."""

from __future__ import annotations

import math

import numpy as np

from ropeode.analysis.equilibrium import frequencies
from ropeode.checking.check_context import Examination
from ropeode.checking.check_ropes import hanging
from ropeode.checking.report import Finding
from ropeode.problems.problem import Problem
from ropeode.simulation.step_map import StepMap

# The largest dt omega of each method in theory: where its stability function leaves the unit
# disc on the imaginary axis (Hairer, Wanner, Solving Ordinary Differential Equations II, section
# IV.2), and for the others Hairer, Lubich, Wanner, Geometric Numerical Integration, section I.5.
LIMITS = {
    "explicit-euler": 0.0,
    "semi-implicit-euler": 2.0,
    "stormer-verlet": 2.0,
    "velocity-verlet": 2.0,
    "rk4": 2.0 * math.sqrt(2.0),
}
# In units of 1/omega: where the search begins and ends.
_SMALLEST, _LARGEST = 0.05, 8.0
_GRID = 24
# Growth of a mode per step that finite differences cannot distinguish from none.
_GROWTH = 1e-6
_PRECISION = 1e-4
# The relative difference from theory that is allowed.
_AGREE = 0.01


def stability(examination: Examination) -> Finding:
    """The largest ``dt omega`` at which small undamped oscillations do not grow."""
    limit = _stability_limit(examination)
    evidence = {"limit": limit}
    line = _words(limit)
    method = (examination.claims.method or "").partition(":")[0]
    if method not in LIMITS:
        return Finding("stability", "note", line, evidence)
    theory = LIMITS[method]
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


def _stability_limit(examination: Examination) -> float:
    """The largest ``dt omega`` up to which no mode of a hanging rope grows.

    The eigenvalues of the derivative of one step about the rope at rest are the factors by
    which modes grow (von Neumann's criterion); omega is the rope's largest frequency. The limit
    is 0 if the stepper is unstable at the smallest step tried, and 8 if it is stable at the
    largest.
    """
    problem = hanging()
    one_step = StepMap(problem, examination.method)
    omega = float(frequencies(problem, problem.y0)[-1])

    def stable(z: float) -> bool:
        return _largest_factor(one_step, problem, z / omega) <= 1.0 + _GROWTH

    grid = np.geomspace(_SMALLEST, _LARGEST, _GRID).tolist()
    unstable = next((i for i, z in enumerate(grid) if not stable(z)), None)
    if not unstable:
        return _LARGEST if unstable is None else 0.0
    low, high = grid[unstable - 1 : unstable + 1]
    while high - low > _PRECISION * high:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if stable(middle) else (low, middle)
    return 0.5 * (low + high)


def _largest_factor(one_step: StepMap, problem: Problem, dt: float) -> float:
    """The spectral radius of one step, over the movable part of what the stepper carries."""
    carried = one_step.start(problem.y0, dt)
    free = np.broadcast_to((problem.args.free > 0.0)[:, None], problem.y0.shape[1:])
    matrix = one_step.derivative(carried, dt, one_step.moving(carried, free))
    if not np.all(np.isfinite(matrix)):
        return np.inf
    return float(np.max(np.abs(np.linalg.eigvals(matrix))))
