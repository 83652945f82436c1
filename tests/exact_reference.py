"""References that cost nothing: exact solutions, certified as if solvers had found them.

Where there is no formula, the tests' own solver finds them: it compiles nothing.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ropeode import Problem, reference
from ropeode.references import DOPRI8, Certificate, Reference
from tests.verification.extrapolation import EPS, integrate, rope_solution


def exact_reference(problem: Problem, states: np.ndarray, bound: float = 1e-14) -> Reference:
    """The exact solution of a problem as its reference, trusted to the end."""
    certificate = Certificate(
        level="consensus",
        solver=DOPRI8,
        rtol=1e-13,
        atol=1e-13,
        steps=1,
        accuracy=1e-8,
        bounds=dict.fromkeys(problem.quantities, np.full(len(states), bound)),
        drift={},
        trusted=len(states),
        horizon=None,
        horizon_reason=None,
        witnesses=(),
        stiff=False,
        seconds=0.0,
        compile_seconds=0.0,
        versions={},
    )
    return Reference(problem, states, certificate)


def rope_reference(problem: Problem) -> Reference:
    """Likewise of a rope of either kind."""
    return _solved(problem, lambda: rope_solution(problem))


def mechanics_reference(problem: Problem, acceleration: Callable) -> Reference:
    """Likewise of a second-order problem.

    Arguments:
        acceleration: its own, which takes NumPy as ``xp``.
    """

    def rhs(t: np.ndarray, y: np.ndarray) -> np.ndarray:
        x, v = y[:, 0], y[:, 1]
        return np.stack([v, acceleration(t[:, 0], x, v, problem.args, xp=np)], axis=1)

    return _solved(problem, lambda: integrate(rhs, problem.y0, problem.ts))


def _solved(problem: Problem, solve: Callable[[], np.ndarray]) -> Reference:
    if EPS > 2e-19:
        return reference(problem)
    # What is left is the rounding to float64.
    bound = 16 * np.finfo(np.float64).eps * problem.scale
    return exact_reference(problem, solve().astype(np.float64), bound)
