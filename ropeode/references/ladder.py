"""The solvers of a problem, the tolerance ladder, and the runs beside it."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ropeode.errors import ReferenceRefused
from ropeode.problems import Problem, free_coordinates
from ropeode.progress import Progress, silent
from ropeode.references.certificate import Role
from ropeode.references.defect import Findings
from ropeode.references.solvers.one_run import solve
from ropeode.references.solvers.solution import Path, Solution
from ropeode.references.solvers.solver import (
    DOPRI8,
    KVAERNO5,
    MOST_DENSE,
    OWN_DOP853,
    SCIPY_BDF,
    SCIPY_DOP853,
    SCIPY_RADAU,
    Solver,
)

# A solver of order p needs 10^(1/p) times the steps for one more digit: 1.33 for Dopri8 and
# 1.58 for Kvaerno5. Where one more digit costs more than this factor, the error estimate has
# drowned in rounding, and a tighter tolerance gains nothing.
_MOST_STEPS_PER_DIGIT = 2.5

# A solver that has needed so many steps counts as the wrong one for a problem.
_STEPS, _STEPS_PER_FRAME = 100_000, 4_000
_SHORT_STEPS_PER_FRAME = 32
# Where that is more steps than this, each frame has fewer, but still several.
_MOST_SHORT_STEPS, _FEWEST_SHORT_STEPS_PER_FRAME = 100_000, 4
# Ten thousand take two seconds.
_MOST_STEPS_IN_PYTHON = 10_000
_FEWEST_SHORT_STEPS = 1000
_FEWEST_RUNGS = 3
# The neighbour, short steps, moved roundings, and what takes as long as a few runs of the ladder.
_RUNS_AFTER_THE_LADDER = 8
# Of the two runs with moved roundings. See `solvers.rounding` for why these two.
_ROUNDING_SEEDS = (1, 2)
_LOOSEST_ROUNDING = 1e-9
_LOOSEST_PATH = 1e-10
# Of a run that shows no more than how large the components are.
_ROUGH, _ROUGH_STEPS = 1e-3, 2000
# On the heat equation Radau's error at this tolerance is a hundredth of that of BDF at 1e-12.
_TIGHTEST_BESIDE_BDF = 1e-10
# A ladder that needs more memory than this keeps the states of two rungs only.
_MOST_BYTES_KEPT = 2**28
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
IMPLICIT_SOLVERS = Method(KVAERNO5, SCIPY_RADAU, (1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12))
# For large problems whose Jacobian is sparse. BDF solves one system of the state's size in each
# step, and Kvaerno5 six; JAX has no sparse factorization.
SPARSE = Method(SCIPY_BDF, SCIPY_RADAU, (1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13))
METHODS = (EXPLICIT_SOLVERS, IMPLICIT_SOLVERS, SPARSE)


def step_budget(problem: Problem) -> int:
    """The number of steps after which a solver counts as the wrong one for a problem."""
    return _STEPS + _STEPS_PER_FRAME * problem.frames


def short_steps(problem: Problem, ts: np.ndarray) -> np.ndarray:
    """The longest steps of the run that must not step over anything.

    Error control sees a right-hand side only at the stages of a step, so that every solver can
    step over a narrow pulse that nothing announces. The limit is a fraction of each frame's own
    length: in frames much shorter than the others, all other runs may take one step per frame,
    the same one at every tolerance.

    Arguments:
        problem: whose frames count.
        ts: sample times of the run, ``(times,)``; each interval lies in one frame.

    Returns:
        The longest step for each interval of `ts`, ``(times - 1,)``.
    """
    in_many = max(_MOST_SHORT_STEPS / problem.frames, _FEWEST_SHORT_STEPS_PER_FRAME)
    parts = min(_SHORT_STEPS_PER_FRAME, in_many)
    parts = max(parts, _FEWEST_SHORT_STEPS / problem.frames)
    frame = np.searchsorted(problem.ts, ts[:-1], side="right") - 1
    return np.diff(problem.ts)[frame] / parts


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
    if method.primary.library == "diffrax":
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


def neighbour(problem: Problem, states: np.ndarray) -> np.ndarray:
    """The initial state with each component moved by one unit of rounding, up or down.

    Zeros move up, because a solution that is not unique, or an unstable balance, would otherwise
    agree with itself: by a unit of rounding of the largest initial component; in a mechanical
    problem of the largest position or velocity on the way. There what is held fixed stays.

    Arguments:
        problem: what is solved.
        states: its solution, ``(times, *y0.shape)``.
    """
    y0 = problem.y0
    up = np.random.default_rng(1).integers(0, 2, size=y0.shape).astype(bool)
    moved = np.nextafter(y0, np.where(up, np.inf, -np.inf))
    sizes: Any = problem.scale
    if problem.mechanics is not None and not np.all(y0):
        sizes = np.max(np.abs(states), axis=(0, *range(2, states.ndim)), keepdims=True)[0]
        sizes = np.where(free_coordinates(problem), np.where(sizes > 0, sizes, problem.scale), 0.0)
    return np.where(y0 == 0.0, np.finfo(np.float64).eps * sizes, moved)


def other_runs(
    problem: Problem, solved: Problem, primary: Solution
) -> list[tuple[Role, dict[str, Any]]]:
    """The witnesses of the primary solver that are not rungs: what `solve_primary` takes.

    Arguments:
        problem: that of the reference.
        solved: the same one, or with other sample times.
        primary: the run that the witnesses are compared with. None of them should take many more
            steps.
    """
    most, longest = 4 * primary.steps + 1000, short_steps(problem, solved.ts)
    short = most + 4 * math.ceil(np.sum(np.diff(solved.ts) / longest))
    limit = independent_steps(primary)
    return [
        ("neighbour", {"y0": neighbour(solved, primary.states), "max_steps": most}),
        ("short steps", {"longest_steps": longest, "max_steps": short}),
        *(("rounding", {"rounding_seed": seed, "max_steps": limit}) for seed in _ROUNDING_SEEDS),
    ]


def solve_other(
    problem: Problem,
    method: Method,
    rtol: float,
    role: Role,
    options: dict[str, Any],
    budget: Budget,
) -> Solution:
    """One of `other_runs`. What rounding keeps from its end gets there at a looser tolerance."""
    run = solve_primary(problem, method, rtol, budget, **options)
    while role == "rounding" and run.failure and run.rtol < _LOOSEST_ROUNDING:
        run = solve_primary(problem, method, 100 * run.rtol, budget, **options)
    return run


def recall(problem: Problem, method: Method, rung: Solution, budget: Budget) -> Solution:
    """A rung with its states; computes them again if `climb` has dropped them."""
    if len(rung.states):
        return rung
    return solve_primary(problem, method, rung.rtol, budget)


def independent_steps(like: Solution) -> int:
    """The number of steps after which an independent solver counts as stuck.

    Ten times as many as the primary solver's run `like` takes at the same tolerance.
    """
    return 10 * like.steps + 1000


def independent_rtol(method: Method, tightest: Solution) -> float:
    """The relative tolerance of the independent run: that of the next tighter rung, or tighter.

    The right-hand side is evaluated along that run, between its steps. There it is close to the
    solution only where the steps are short. Beside BDF it is looser: Radau's error is far below
    its tolerance, and that of BDF far above.
    """
    if method is SPARSE:
        return max(tightest.rtol, _TIGHTEST_BESIDE_BDF)
    return min(tightest.rtol, _LOOSEST_PATH) if method is EXPLICIT_SOLVERS else tightest.rtol


def solve_independent(
    problem: Problem, method: Method, tightest: Solution, looser: Solution, budget: Budget
) -> Solution:
    """The SciPy solver at `independent_rtol`; at the tolerance of `looser` if it gets stuck.

    Where it would take many steps, each with a dozen calls from Python, the same method is
    compiled.
    """
    tries = (independent_rtol(method, tightest), tightest), (looser.rtol, looser)
    for rtol, like in tries:
        solver = OWN_DOP853 if is_long(problem, method, tightest) else method.independent
        budget.progress(f"reference: {solver} at {rtol:.0e}", None)
        limits = {"max_steps": independent_steps(like), "seconds": budget.left}
        run = solve(problem, solver, rtol, rtol * budget.scale, **limits)
        budget.spent += run.seconds
        if run.failure is None or budget.left == 0.0:
            break
    return run


def rough_path(problem: Problem, method: Method, budget: Budget) -> Path | None:
    """The steps of a loose run of the independent solver, where the ladder has failed."""
    if problem.y0.size > MOST_DENSE:
        return None
    tolerances = _ROUGH, _ROUGH * budget.scale
    limits = {"max_steps": _ROUGH_STEPS, "seconds": budget.left}
    return solve(problem, method.independent, *tolerances, **limits).path


def is_long(problem: Problem, method: Method, like: Solution) -> bool:
    """Whether a run of SciPy's solver in Python, with as many steps as another, takes long."""
    compiles = not problem.jump_times and not problem.in_python
    return method is EXPLICIT_SOLVERS and compiles and like.steps > _MOST_STEPS_IN_PYTHON


def solve_closely(
    problem: Problem, method: Method, like: Solution, findings: Findings, budget: Budget
) -> Solution:
    """The SciPy solver once more, with steps that end where something was found between steps."""
    budget.progress(f"reference: {method.independent} between its steps", None)
    more = 4 * len(findings.stops) + 200 * len(findings.times)
    run = solve(
        problem,
        method.independent,
        like.rtol,
        like.atol,
        max_steps=2 * like.steps + 1000 + more,
        seconds=budget.left,
        stops=findings.stops,
    )
    budget.spent += run.seconds
    return run
