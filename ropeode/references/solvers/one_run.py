"""One run of one solver, whichever library has it."""

from __future__ import annotations

from typing import Any

import numpy as np

from ropeode.problems import Problem
from ropeode.references.solvers import diffrax_solver
from ropeode.references.solvers.solution import Solution
from ropeode.references.solvers.solver import OWN_DOP853, Solver


def solve(
    problem: Problem, solver: Solver, rtol: float, atol: float | np.ndarray, **more: Any
) -> Solution:
    """Solve a problem in float64, each sample time being the end of a step.

    Arguments:
        problem: what to solve.
        solver: of diffrax, of SciPy, or `OWN_DOP853`.
        rtol: relative tolerance.
        atol: absolute tolerance: one number, or an array of the state's shape.
        more: limits and options of `diffrax_solver.solve`, `scipy_solver.solve` or
            `compiled_dop853.solve`.
    """
    if solver.runs_in_diffrax:
        return diffrax_solver.solve(problem, solver, rtol, atol, **more)
    # Not above: a reference from a file needs no solver, and importing SciPy's takes long.
    from ropeode.references.solvers import compiled_dop853, scipy_solver

    if solver == OWN_DOP853:
        return compiled_dop853.solve(problem, rtol, atol, **more)
    return scipy_solver.solve(problem, solver, rtol, atol, **more)
