"""The float64 runs that a certificate rests on beside its ladder."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ropeode.problems import Problem, free_coordinates
from ropeode.references.certificate import Role
from ropeode.references.defect import Findings
from ropeode.references.ladder import (
    EXPLICIT_SOLVERS,
    SPARSE,
    Budget,
    Method,
    solve_primary,
)
from ropeode.references.solvers.one_run import solve
from ropeode.references.solvers.solution import Path, Solution
from ropeode.references.solvers.solver import MOST_DENSE, OWN_DOP853

_SHORT_STEPS_PER_FRAME = 32
# Where that is more steps than this, each frame has fewer, but still several.
_MOST_SHORT_STEPS, _FEWEST_SHORT_STEPS_PER_FRAME = 100_000, 4
# Ten thousand take two seconds.
_MOST_STEPS_IN_PYTHON = 10_000
_FEWEST_SHORT_STEPS = 1000
_EPS = float(np.finfo(np.float64).eps)
_MOVES_OF_ZEROS = (_EPS, _EPS**2)
# Of the two runs with moved roundings. See `solvers.rounding` for why these two.
_ROUNDING_SEEDS = (1, 2)
_LOOSEST_ROUNDING = 1e-9
_LOOSEST_PATH = 1e-10
# Of a run that shows no more than how large the components are.
_ROUGH, _ROUGH_STEPS = 1e-3, 2000
# Radau's error at 1e-11 is 2e-13 of the state on the Oregonator, and 6e-10 on Van der Pol's,
# as at 1e-10. On the heat equation it is, at 1e-10, a hundredth of that of BDF at 1e-12.
_TIGHTEST_RADAU, _TIGHTEST_BESIDE_BDF = 1e-11, 1e-10


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


def neighbour(problem: Problem, states: np.ndarray, zeros: float = _EPS) -> np.ndarray:
    """The initial state with each component moved by one unit of rounding, up or down.

    Zeros move up, because a solution that is not unique, or an unstable balance, would otherwise
    agree with itself: by a unit of rounding of the largest initial component; in a mechanical
    problem of the largest position or velocity on the way. There what is held fixed stays.

    Arguments:
        problem: what is solved.
        states: its solution, ``(times, *y0.shape)``.
        zeros: how far zeros move, in those sizes.
    """
    y0 = problem.y0
    up = np.random.default_rng(1).integers(0, 2, size=y0.shape).astype(bool)
    moved = np.nextafter(y0, np.where(up, np.inf, -np.inf))
    sizes: Any = problem.scale
    if problem.mechanics is not None and not np.all(y0):
        sizes = np.max(np.abs(states), axis=(0, *range(2, states.ndim)), keepdims=True)[0]
        sizes = np.where(free_coordinates(problem), np.where(sizes > 0, sizes, problem.scale), 0.0)
    return np.where(y0 == 0.0, zeros * sizes, moved)


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
    starts = [neighbour(solved, primary.states, zeros) for zeros in _MOVES_OF_ZEROS]
    return [
        ("neighbour", {"y0": starts, "max_steps": most}),
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
    """One of `other_runs`. What rounding keeps from its end gets there at a looser tolerance.

    Nor has every neighbour a solution: where the equation divides by the time, a velocity must
    begin at zero. A neighbour that takes no step at all moves zeros less. One that spends its steps
    later does not: it may have left an unstable balance.
    """
    starts = options.pop("y0", [problem.y0])
    run = solve_primary(problem, method, rtol, budget, y0=starts[0], **options)
    for y0 in starts[1:]:
        if run.reached <= problem.ts[0]:
            run = solve_primary(problem, method, rtol, budget, y0=y0, **options)
    while role == "rounding" and run.failure and run.rtol < _LOOSEST_ROUNDING:
        run = solve_primary(problem, method, 100 * run.rtol, budget, **options)
    return run


def independent_steps(like: Solution) -> int:
    """The number of steps after which an independent solver counts as stuck.

    Ten times as many as the primary solver's run `like` takes at the same tolerance.
    """
    return 10 * like.steps + 1000


def independent_rtol(method: Method, tightest: Solution) -> float:
    """The relative tolerance of the independent run: that of the next tighter rung, or tighter.

    The right-hand side is evaluated along that run, between its steps. There it is close to the
    solution only where the steps are short. That of Radau may be looser: its error is mostly far
    below its tolerance, and a step in Python takes a thousand times as long as a compiled one.
    """
    if method is EXPLICIT_SOLVERS:
        return min(tightest.rtol, _LOOSEST_PATH)
    return max(tightest.rtol, _TIGHTEST_BESIDE_BDF if method is SPARSE else _TIGHTEST_RADAU)


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


def solve_beyond_float64(
    problem: Problem, solved: Problem, primary: Solution, budget: Budget
) -> Solution | None:
    """A run with more digits, where that is cheap; the arguments are those of `other_runs`."""
    # Not above: heyoka is an extra.
    from ropeode.references.extended.witness import run_beyond_float64

    longest = short_steps(problem, solved.ts)
    return run_beyond_float64(solved, primary, longest, budget.progress)


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
