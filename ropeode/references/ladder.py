"""The tolerance ladder: the solver that fits a problem, at tighter and tighter tolerances."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ropeode.errors import ReferenceRefused
from ropeode.problems import Problem
from ropeode.progress import Progress, silent
from ropeode.references.solvers.one_run import solve
from ropeode.references.solvers.solution import Solution
from ropeode.references.solvers.solver import (
    DOPRI8,
    MOST_DENSE,
    RADAU9,
    SCIPY_BDF,
    SCIPY_DOP853,
    SCIPY_RADAU,
    Solver,
)

# A solver whose error estimate is of order p needs 10^(1/p) times the steps for one more digit:
# 1.33 for Dopri8 and 1.47 for Radau9. Where one more digit costs more than this factor, the error
# estimate has drowned in rounding, and a tighter tolerance gains nothing.
_MOST_STEPS_PER_DIGIT = 2.5

# A solver that has needed so many steps counts as the wrong one for a problem.
_STEPS, _STEPS_PER_FRAME = 100_000, 4_000
_FEWEST_RUNGS = 3
# The neighbour, short steps, moved roundings, and what takes as long as a few runs of the ladder.
_RUNS_AFTER_THE_LADDER = 8
# A ladder that needs more memory than this keeps the states of two rungs only.
_MOST_BYTES_KEPT = 2**28
# A run that has taken so many steps is looked at: is the problem stiff, does it get anywhere?
_MOST_STEPS = 500_000
# Of a large problem sooner: its steps take long.
_MOST_STEPS_IF_LARGE = 10_000
# Solving equations in each step has to be worth it: Radau9 gets this part of Dopri8's steps.
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


@dataclasses.dataclass(eq=False)
class Budget:
    """The time for all runs of one reference, counted as they are made.

    Arguments:
        scale: the absolute tolerance of each run, divided by its relative one: one number, or an
            array of the state's shape.
        seconds: that all runs may take together. Compiling does not count, so that what was
            compiled before does not change a result.
        progress: called before each run, with what it is.
        samples: how many sample times the whole problem has. Programs are compiled for them, and
            serve what is left of the problem where a run ends early.
        spent: seconds that the runs have taken so far.
    """

    scale: Any
    seconds: float = math.inf
    progress: Progress = silent
    samples: int = 0
    spent: float = 0.0

    @property
    def left(self) -> float:
        """Seconds that are left."""
        return max(self.seconds - self.spent, 0.0)


@dataclasses.dataclass(frozen=True)
class Method:
    """Solvers of one kind, and the tolerances of the ladder where the user gives none.

    Arguments:
        primary: a diffrax solver, or one of SciPy's where diffrax has none.
        independent: a SciPy solver.
        tolerances: from loose to tight.
    """

    primary: Solver
    independent: Solver
    tolerances: tuple[float, ...]


EXPLICIT_SOLVERS = Method(DOPRI8, SCIPY_DOP853, (1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13, 1e-14))
IMPLICIT_SOLVERS = Method(RADAU9, SCIPY_RADAU, (1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12))
# For large problems whose Jacobian is sparse. BDF solves one system of the state's size in each
# step, and Radau9 three; JAX has no sparse factorization.
SPARSE = Method(SCIPY_BDF, SCIPY_RADAU, (1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13))
METHODS = (EXPLICIT_SOLVERS, IMPLICIT_SOLVERS, SPARSE)


def step_budget(problem: Problem) -> int:
    """The number of steps after which a solver counts as the wrong one for a problem."""
    return _STEPS + _STEPS_PER_FRAME * problem.frames


def solve_primary(
    problem: Problem,
    method: Method,
    rtol: float,
    budget: Budget,
    *,
    share: float = 1.0,
    **more: Any,
) -> Solution:
    """The primary solver of a method at one tolerance; `more` is for its function `solve`.

    Arguments:
        problem: what to solve.
        method: whose primary solver.
        rtol: relative tolerance.
        budget: of the reference.
        share: the part of the time left that the run may take.
        more: as above.
    """
    budget.progress(f"reference: {method.primary} at {rtol:.0e}", None)
    atol, seconds = rtol * budget.scale, share * budget.left
    if method.primary.runs_in_diffrax:
        more = {"room": budget.samples, **more}
    run = solve(problem, method.primary, rtol, atol, seconds=seconds, **more)
    budget.spent += run.seconds
    return run


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
    # Not above: it imports SciPy's solvers, which takes long.
    from ropeode.references.solvers.scipy_solver import sparsity

    return not problem.in_python and sparsity(problem) is not None


def in_time(problem: Problem, run: Solution, rungs: int, budget: Budget, note: str = "") -> Problem:
    """The problem up to the last sample for which the time suffices.

    Arguments:
        problem: what is solved.
        run: the last run, which may have stopped on its way.
        rungs: how many there are.
        budget: of the reference.
        note: for the refusal, a sentence with a space before it.

    Raises:
        ReferenceRefused: it does not suffice for the first frame.
    """
    start = problem.ts[0]
    way = min(run.reached, problem.ts[-1]) - start
    needed = _runs_to_come(rungs) * run.seconds * (problem.ts - start) / way
    samples = int(np.searchsorted(needed, budget.left, side="right"))
    if samples >= len(problem.ts):
        return problem
    if samples < 2:
        raise ReferenceRefused(
            f"no reference for {problem.name!r}: {run.solver} at rtol {run.rtol:.0e} came to t = "
            f"{run.reached:g} in {run.steps} steps and {run.seconds:.2g} s. All runs to t = "
            f"{problem.ts[1]:g} would take {budget.spent + needed[1]:.2g} s or more, and the time "
            f"limit is {budget.seconds:g} s. Allow more time (time_limit), sample earlier, or ask "
            f"for a looser rtol.{note}"
        )
    return problem.until(samples)


def _runs_to_come(rungs: int) -> int:
    """How many runs a reference needs at least after so many rungs, each as long as the last."""
    return max(_FEWEST_RUNGS - rungs, 1) + _RUNS_AFTER_THE_LADDER


def climb(
    problem: Problem,
    method: Method,
    first: Solution,
    tolerances: Sequence[float],
    budget: Budget,
) -> tuple[Problem, list[Solution]]:
    """The primary solver at tighter and tighter tolerances, while that gains anything.

    In a large problem only the last two rungs keep their states; `recall` computes the others
    again.

    Returns:
        The problem up to the last sample for which the time suffices, and the rungs.

    Raises:
        ReferenceRefused: the time does not suffice for the first frame.
    """
    rungs = [first]
    if len(first.states) < 2:
        return problem, rungs
    for rtol in tolerances:
        try:
            problem = in_time(problem, rungs[-1], len(rungs), budget)
        except ReferenceRefused:
            if len(rungs) < _FEWEST_RUNGS:
                raise
            break
        limit = int(_MOST_STEPS_PER_DIGIT * rungs[-1].steps) + 1000
        run = solve_primary(problem, method, rtol, budget, max_steps=limit)
        if len(run.states) < min(len(rungs[-1].states), len(problem.ts)):
            break
        rungs.append(run)
        if len(rungs) > 2 and len(tolerances) * run.states.nbytes > _MOST_BYTES_KEPT:
            rungs[-3] = rungs[-3].without_states()
    return problem, rungs


def recall(problem: Problem, method: Method, rung: Solution, budget: Budget) -> Solution:
    """A rung with its states; computes them again if `climb` has dropped them."""
    if len(rung.states):
        return rung
    return solve_primary(problem, method, rung.rtol, budget)
