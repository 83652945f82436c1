"""The float64 runs that a certificate rests on, made again to have their states."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import get_args

from ropeode.problems.problem import Problem
from ropeode.references.certificate import Role
from ropeode.references.consensus import neighbour
from ropeode.references.ladder import (
    EXPLICIT,
    IMPLICIT,
    SIDE_BY_SIDE,
    Method,
    Progress,
    independent_budget,
    short_steps,
    solve_independent,
    solve_primary,
    step_budget,
)
from ropeode.references.reference import Reference
from ropeode.references.solvers.solution import Solution


def method_of(known: Reference) -> Method:
    """The solvers of a reference of level `consensus`."""
    return IMPLICIT if known.certificate.stiff else EXPLICIT


def witness_runs(
    known: Reference,
    progress: Progress = lambda text: None,
    *,
    problem: Problem | None = None,
    primary: Solution | None = None,
    roles: Collection[Role] = get_args(Role),
) -> Iterator[tuple[Role, Solution]]:
    """Each witness of a reference of level `consensus`, with its role and its states.

    A witness keeps its differences from the reference only. The solvers do the same thing
    each time, so that these are the states that it had.

    Arguments:
        known: the reference.
        progress: called with a few words before each run.
        problem: the same with other sample times, where those are wanted.
        primary: the reference's solver on that problem.
        roles: of the witnesses that are wanted; the tighter ones are always made.
    """
    made, method = known.certificate, method_of(known)
    problem = problem or known.problem
    primary = primary or Solution(
        made.solver, made.rtol, made.atol, known.states, made.steps, seconds=0.0
    )
    more = {
        "neighbour": {"y0": neighbour(problem)},
        "short steps": {
            "max_steps": 2 * step_budget(problem),
            "longest_steps": short_steps(known.problem, problem.ts),
        },
    }
    next_tighter = primary
    for witness in made.witnesses:
        role = witness.role
        if role not in roles and role != "tighter":
            continue
        if witness.solver == SIDE_BY_SIDE:
            # Not above: it imports SciPy's solvers, which takes long.
            from ropeode.references.solvers import dop853

            budget = independent_budget(problem, next_tighter)
            (run,) = dop853.solve([problem], [next_tighter.rtol], max_steps=[budget])
        elif role == "independent":
            run = solve_independent(problem, method, next_tighter, primary, progress)
        else:
            run = solve_primary(problem, method, witness.tolerance, progress, **more.get(role, {}))
        if role == "tighter" and next_tighter is primary:
            next_tighter = run.without_states()
        if role in roles:
            yield role, run
