"""The float64 runs that a certificate rests on, made again to have their states."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

from ropeode.references.certificate import Role
from ropeode.references.ladder import (
    EXPLICIT,
    IMPLICIT,
    Progress,
    short_step,
    solve_independent,
    solve_primary,
    step_budget,
)
from ropeode.references.reference import Reference, neighbour
from ropeode.references.solution import Solution


def witness_runs(
    known: Reference, progress: Progress = lambda text: None
) -> Iterator[tuple[Role, Solution]]:
    """Each witness of a reference of level `consensus`, with its role and its states.

    A witness keeps its differences from the reference only. The solvers do the same thing
    each time, so that these are the states that it had.

    Arguments:
        known: the reference.
        progress: called with a few words before each run.
    """
    problem, made = known.problem, known.certificate
    method = IMPLICIT if made.stiff else EXPLICIT
    primary = Solution(made.solver, made.rtol, made.atol, known.states, made.steps, 0.0)
    next_tighter = max(
        (w for w in made.witnesses if w.role == "tighter"), key=lambda w: w.tolerance
    )
    tighter = dataclasses.replace(primary, rtol=next_tighter.tolerance, steps=next_tighter.steps)
    for witness in made.witnesses:
        if witness.role == "independent":
            run = solve_independent(problem, method, tighter, primary, progress)
        else:
            more = {
                "neighbour": {"y0": neighbour(problem)},
                "short steps": {
                    "max_steps": 2 * step_budget(problem),
                    "longest_step": short_step(problem),
                },
            }
            run = solve_primary(
                problem, method, witness.tolerance, progress, **more.get(witness.role, {})
            )
        yield witness.role, run
