"""References of level `consensus`: float64 runs of two kinds of solvers that agree."""

from __future__ import annotations

import dataclasses
import functools
import platform
from importlib import metadata

import numpy as np

from ropeode.errors import ReferenceRefused
from ropeode.problems.problem import Problem
from ropeode.references.certificate import (
    Certificate,
    Role,
    Witness,
    bounds,
    from_tightest,
    trusted_samples,
    witness,
)
from ropeode.references.ladder import (
    EXPLICIT,
    IMPLICIT,
    Method,
    Progress,
    climb,
    recall,
    short_steps,
    solve_independent,
    solve_primary,
    step_budget,
)
from ropeode.references.reference import (
    FINEST_ACCURACY,
    RELATIVE_ACCURACY,
    Reference,
    motion,
)
from ropeode.references.solvers.solution import Solution

TIGHTEST_RTOL = 1e-14
_PACKAGES = ("ropeode", "diffrax", "jax", "jaxlib", "numpy", "scipy")


@dataclasses.dataclass(frozen=True, eq=False)
class Primary:
    """All that the primary solver has to say of a problem.

    Arguments:
        problem: what was solved.
        method: with what.
        run: the one that is to be the reference.
        next_tighter: the rung of the ladder after it, without its states.
        rungs: of the tolerance ladder, without their states.
        away: how far each rung is from the tightest, `from_tightest`.
        witnesses: the primary's other runs, held against it.
        others: those of them that are not rungs, without their states.
    """

    problem: Problem
    method: Method
    run: Solution
    next_tighter: Solution
    rungs: tuple[Solution, ...]
    away: tuple[np.ndarray, ...]
    witnesses: tuple[Witness, ...]
    others: tuple[Solution, ...]


def consensus_reference(
    problem: Problem,
    accuracy: float | None,
    rtol: float | None,
    *,
    progress: Progress,
) -> Reference:
    """A reference of level `consensus`; see `ropeode.reference`.

    Arguments:
        problem: what to solve.
        accuracy: as for `ropeode.reference`, checked.
        rtol: as for `ropeode.reference`, checked.
        progress: called with a few words before each run.

    Raises:
        ReferenceRefused: not even the first sample can be trusted; says why.
    """
    primary = primary_runs(problem, rtol, progress)
    independent = solve_independent(
        problem, primary.method, primary.next_tighter, primary.run, progress
    )
    return certified(primary, independent, accuracy, rtol)


def primary_runs(problem: Problem, rtol: float | None, progress: Progress) -> Primary:
    """Run the primary solver on its ladder, from a neighbouring state, and with short steps.

    Arguments:
        problem: what to solve.
        rtol: as for `ropeode.reference`, checked.
        progress: called with a few words before each run.

    Raises:
        ReferenceRefused: the ladder is too short.
    """
    method, rungs = _ladder(problem, rtol, progress)
    primary_index = len(rungs) - 2 if rtol is None else 2
    if not 0 < primary_index < len(rungs) - 1 or len(rungs[-1].states) < 2:
        last = rungs[-1]
        why = last.failure or "is the tightest run that gains anything; three rungs are needed"
        raise ReferenceRefused(
            f"no reference for {problem.name!r}: {last.solver} at rtol {last.rtol:.0e} "
            f"{why}. Start where the right-hand side is smooth, declare its jump times, sample "
            "earlier, or ask for a looser rtol."
        )
    primary, tightest = recall(problem, method, rungs[primary_index], progress), rungs[-1]
    witnesses, away = [], []
    for index, rung in enumerate(rungs):
        run = primary if index == primary_index else recall(problem, method, rung, progress)
        away.append(from_tightest(problem, run, tightest))
        if index != primary_index:
            role = "looser" if index < primary_index else "tighter"
            witnesses.append(witness(problem, primary, run, role))
        del run
    told = tuple(rung.without_states() for rung in rungs)
    del rungs, tightest
    others = []

    def hold_against(run: Solution, role: Role) -> None:
        witnesses.append(witness(problem, primary, run, role))
        others.append(run.without_states())

    hold_against(
        solve_primary(problem, method, primary.rtol, progress, y0=neighbour(problem)), "neighbour"
    )
    hold_against(
        solve_primary(
            problem,
            method,
            primary.rtol,
            progress,
            max_steps=2 * step_budget(problem),
            longest_steps=short_steps(problem, problem.ts),
        ),
        "short steps",
    )
    return Primary(
        problem=problem,
        method=method,
        run=primary,
        next_tighter=told[primary_index + 1],
        rungs=told,
        away=tuple(away),
        witnesses=tuple(witnesses),
        others=tuple(others),
    )


def certified(
    made: Primary, independent: Solution, accuracy: float | None, rtol: float | None
) -> Reference:
    """The reference, with what the runs say of it.

    Arguments:
        made: by the primary solver.
        independent: a run of another one.
        accuracy: as for `ropeode.reference`, checked.
        rtol: as for `ropeode.reference`, checked.

    Raises:
        ReferenceRefused: not even the first sample can be trusted; says why.
    """
    problem, primary = made.problem, made.run
    witnesses = (*made.witnesses, witness(problem, primary, independent, "independent"))
    every = (*made.rungs, *made.others, independent)
    drift = problem.drift(primary.states)
    estimated = bounds(problem, primary, witnesses, drift)
    bound = estimated[problem.quantities[0]]
    if accuracy is None:
        relative = max(RELATIVE_ACCURACY, 1e4 * rtol if rtol else 0.0)
        accuracy = max(
            relative * _motion_while_known(problem, primary.states, bound),
            FINEST_ACCURACY * problem.scale,
        )
    trusted, reason = trusted_samples(problem, made.rungs, made.away, bound, witnesses, accuracy)
    if trusted < 2:
        failures = "; ".join(f"{run.solver} {run.failure}" for run in every if run.failure)
        raise ReferenceRefused(
            f"no reference for {problem.name!r}: at t = {problem.ts[1]:g} already {reason} (bound "
            f"{bound[1]:.1e}, accuracy {accuracy:.1e}"
            + (f"; {failures}" if failures else "")
            + "). Ask for less accuracy, declare jump times if the right-hand side has jumps, "
            "or see whether it is smooth and in float64."
        )
    return Reference(
        problem=problem,
        states=primary.states,
        certificate=Certificate(
            level="consensus",
            solver=primary.solver,
            rtol=primary.rtol,
            atol=primary.atol,
            steps=primary.steps,
            accuracy=accuracy,
            bounds=estimated,
            drift=drift,
            trusted=trusted,
            horizon=float(problem.ts[trusted]) if trusted < len(problem.ts) else None,
            horizon_reason=reason,
            witnesses=tuple(_inside(w, problem, trusted) for w in witnesses),
            stiff=made.method is IMPLICIT,
            seconds=sum(run.seconds for run in every),
            compile_seconds=sum(run.compile_seconds for run in every),
            versions=dict(_versions()),
        ),
    )


@functools.cache
def _versions() -> dict[str, str]:
    """Of the packages that take part."""
    found = {name: metadata.version(name) for name in _PACKAGES}
    return found | {"python": platform.python_version()}


def _motion_while_known(problem: Problem, states: np.ndarray, bound: np.ndarray) -> float:
    """The motion over the samples where it is known to three digits; past a pole it is not."""
    farthest = motion(problem, states)
    known = bound[: len(farthest)] <= 1e-3 * farthest
    return float(farthest[max(int(np.argmin(known)) - 1, 0)] if not all(known) else farthest[-1])


def _ladder(
    problem: Problem, rtol: float | None, progress: Progress
) -> tuple[Method, list[Solution]]:
    """The ladder of the method that fits the problem: explicit if it gets anywhere."""

    def tolerances(method: Method) -> list[float]:
        if rtol is None:
            return list(method.tolerances)
        asked = [100 * rtol, 10 * rtol, rtol, rtol / 10, rtol / 100]
        return [tolerance for tolerance in asked if tolerance > 0.99 * TIGHTEST_RTOL]

    method = EXPLICIT
    first = solve_primary(problem, method, tolerances(method)[0], progress)
    if first.failure and first.steps >= step_budget(problem):
        other = solve_primary(problem, IMPLICIT, tolerances(IMPLICIT)[0], progress)
        if len(other.states) > len(first.states):
            method, first = IMPLICIT, other
    return method, climb(problem, method, first, tolerances(method)[1:], progress)


def neighbour(problem: Problem) -> np.ndarray:
    """The initial state with each component moved by one unit of rounding, up or down.

    Zeros are moved up, by a unit of rounding of the largest component: a solution that is
    not unique must not be held against itself. But in a mechanical problem they stay, since
    a node that is pinned or at rest would begin to drift, unless all are zero.
    """
    y0 = problem.y0
    up = np.random.default_rng(1).integers(0, 2, size=y0.shape).astype(bool)
    moved = np.nextafter(y0, np.where(up, np.inf, -np.inf))
    stays = problem.mechanics is not None and np.any(y0)
    from_zero = 0.0 if stays else np.finfo(np.float64).eps * problem.scale
    return np.where(y0 == 0.0, from_zero, moved)


def _inside(w: Witness, problem: Problem, trusted: int) -> Witness:
    """A witness with its largest difference inside the horizon filled in."""
    differences = w.differences[problem.quantities[0]][:trusted]
    return dataclasses.replace(w, difference=float(np.max(differences)))
