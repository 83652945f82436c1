"""The float64 runs that a certificate rests on, repeated to have their states."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator
from typing import get_args

import numpy as np

from ropeode.problems import Problem
from ropeode.progress import Progress, silent
from ropeode.references.certificate import Role
from ropeode.references.defect import look_between
from ropeode.references.ladder import (
    METHODS,
    Budget,
    Method,
    independent_rtol,
    independent_steps,
    is_long,
    other_runs,
    short_steps,
    solve_closely,
    solve_independent,
    solve_primary,
)
from ropeode.references.reference import Reference
from ropeode.references.solvers.solution import Solution
from ropeode.references.solvers.solver import OWN_DOP853


def method_of(reference: Reference) -> Method:
    """The solvers of a reference of level `consensus`."""
    solver = reference.certificate.solver
    return next(method for method in METHODS if method.primary == solver)


def budget_of(
    reference: Reference, seconds: float = math.inf, progress: Progress = silent
) -> Budget:
    """A budget for more runs of a reference's solvers, with the same ratio of tolerances.

    Arguments:
        reference: of level `consensus`.
        seconds: for all of them together, without compiling.
        progress: called before each run, with what it is.
    """
    certificate, scale = reference.certificate, reference.problem.scale
    # A quotient is rounded, and the default must be found again to the last bit.
    if not np.array_equal(certificate.atol, certificate.rtol * scale):
        scale = np.asarray(certificate.atol) / certificate.rtol
    return Budget(scale, seconds, progress, samples=len(reference.problem.ts))


def primary_solution(reference: Reference) -> Solution:
    """The run that became the reference."""
    certificate = reference.certificate
    return Solution(
        certificate.solver,
        certificate.rtol,
        certificate.atol,
        reference.states,
        certificate.steps,
        seconds=0.0,
    )


def witness_runs(
    reference: Reference,
    budget: Budget | None = None,
    *,
    problem: Problem | None = None,
    primary: Solution | None = None,
    roles: Collection[Role] = get_args(Role),
) -> Iterator[tuple[Role, Solution]]:
    """Each witness of a reference of level `consensus`: its role, and the run with its states.

    A certificate keeps the witnesses' differences from the reference only. The solvers are
    deterministic, so that a repeated run has the same states.

    Arguments:
        reference: whose witnesses to run.
        budget: for the runs; by default one without limits.
        problem: the problem with other sample times; by default that of the reference.
        primary: the run of the reference's solver on that problem.
        roles: of the witnesses to yield. The tighter and the independent ones run in any case.
    """
    method = method_of(reference)
    # Where the solvers stopped, they stop at the last sample before.
    problem = problem or reference.problem.until(len(reference.states))
    primary = primary or primary_solution(reference)
    others = other_runs(reference.problem, problem, primary)
    options = {role: iter([more for kind, more in others if kind == role]) for role, _ in others}
    budget = budget or budget_of(reference)
    next_tighter = independent = primary
    for witness in reference.certificate.witnesses:
        role = witness.role
        if role not in roles and role not in ("tighter", "independent"):
            continue
        if witness.solver == OWN_DOP853 and not is_long(problem, method, next_tighter):
            # Not above: it imports SciPy's solvers, which takes long.
            from ropeode.references.solvers import dop853

            rtol = independent_rtol(method, next_tighter)
            (run,) = dop853.solve(
                [problem],
                [rtol],
                [rtol * budget.scale],
                max_steps=[independent_steps(next_tighter)],
            )
        elif role == "more digits":
            # Not above: heyoka is an extra.
            from ropeode.references.extended.witness import run_beyond_float64

            longest = short_steps(reference.problem, problem.ts)
            run = run_beyond_float64(problem, primary, longest, budget.progress)
            if run is None:
                continue
        elif role == "independent":
            run = solve_independent(problem, method, next_tighter, primary, budget)
        elif role == "close look":
            assert independent.path is not None
            at = np.searchsorted(reference.problem.ts, problem.ts)
            bounds = {name: each[at] for name, each in reference.certificate.bounds.items()}
            findings = look_between(problem, independent.path, bounds, progress=budget.progress)
            run = solve_closely(problem, method, independent, findings, budget)
        else:
            more = next(options.get(role, iter(())), {})
            run = solve_primary(problem, method, witness.tolerance, budget, **more)
        if role == "tighter" and next_tighter is primary:
            next_tighter = run.without_states()
        if role == "independent":
            independent = run
        if role in roles:
            yield role, run
