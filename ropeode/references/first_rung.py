"""The loosest run: which solvers fit a problem, and how far they can take it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from ropeode.problems import Problem
from ropeode.references.budget import Budget
from ropeode.references.ladder import (
    EXPLICIT_SOLVERS,
    IMPLICIT_SOLVERS,
    SPARSE,
    Method,
    in_time,
    solve_primary,
    step_budget,
)
from ropeode.references.solvers.solution import Solution
from ropeode.references.solvers.solver import MOST_DENSE

# A run that has taken so many steps is looked at: is the problem stiff, does it get anywhere?
_MOST_STEPS = 500_000
# Of a large problem sooner: its steps take long.
_MOST_STEPS_IF_LARGE = 10_000
# Solving equations in each step has to be worth it: Kvaerno5 gets this part of Dopri8's steps.
_IMPLICIT_PART = 10
# A run is steady where the second half of its steps takes it this part of its way, or further.
_STEADY = 0.25
# Steps that a steady run may need beyond those expected.
_SLACK = 1.5
# The part of the time that is left for one of the two first runs.
_SHARE = 0.25

_NOT_SPARSE = (
    f" If it is stiff: with more than {MOST_DENSE} unknowns implicit solvers are tried only where "
    "the right-hand side is in JAX and its Jacobian sparse."
)


def first_rung(
    problem: Problem, tolerances: Mapping[Method, Sequence[float]], budget: Budget
) -> tuple[Method, Problem, Solution]:
    """Choose the method, and run it at its loosest tolerance.

    The explicit method is tried first. Where it spends its steps, the implicit one has a try, and
    is chosen if it gets further in a tenth of them. Where neither arrives, the one that is chosen
    goes on only if it makes steady progress: where a right-hand side jumps back and forth without
    end, more steps are wasted. The implicit method of large problems is `SPARSE`; where their
    Jacobian is not sparse, they are left to the explicit one.

    Arguments:
        problem: what to solve.
        tolerances: of each method's ladder, from loose to tight.
        budget: of the reference.

    Returns:
        The method, the problem up to the last sample that can be reached, and the run.

    Raises:
        ReferenceRefused: the time does not suffice for the first frame.
    """

    def run(problem: Problem, method: Method, steps: int, share: float = _SHARE) -> Solution:
        return solve_primary(
            problem, method, tolerances[method][0], budget, max_steps=steps, share=share
        )

    large = problem.y0.size > MOST_DENSE
    most = min(step_budget(problem), _MOST_STEPS_IF_LARGE if large else _MOST_STEPS)
    method, first = EXPLICIT_SOLVERS, run(problem, EXPLICIT_SOLVERS, most)
    implicit = (
        IMPLICIT_SOLVERS if not large else SPARSE if first.ran_out and _is_sparse(problem) else None
    )
    if first.ran_out and implicit is not None:
        other = run(problem, implicit, most // _IMPLICIT_PART)
        if other.reached > first.reached:
            method, first = implicit, other
    if first.ran_out:
        start = problem.ts[0]
        half = run(problem, method, first.steps // 2)
        way = first.reached - start
        if first.reached - half.reached > _STEADY * way:
            problem = in_time(problem, first, 0, budget, "" if implicit else _NOT_SPARSE)
            steps = _SLACK * first.steps * max((problem.ts[-1] - start) / way, 1.0)
            first = run(problem, method, math.ceil(steps), share=1.0)
    return method, problem.until(max(len(first.states), 2)), first


def _is_sparse(problem: Problem) -> bool:
    # Not above: it imports SciPy's sparse matrices, which takes long.
    from ropeode.references.solvers.jacobian_pattern import sparsity

    return not problem.in_python and sparsity(problem) is not None
