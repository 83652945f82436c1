"""References of level `consensus`: float64 runs of two kinds of solvers that agree."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from typing import Literal

import numpy as np

from ropeode.errors import ReferenceRefused
from ropeode.norms import motion
from ropeode.problems import Problem
from ropeode.progress import Progress
from ropeode.references.certificate import (
    Certificate,
    Reason,
    Role,
    Witness,
    bounds,
    default_accuracy,
    distances,
    padded,
    trusted_samples,
    unknown_beyond,
    versions,
    witness,
)
from ropeode.references.defect import look_between
from ropeode.references.hints import coarse_times, hints, unresolved_motion
from ropeode.references.ladder import (
    EXPLICIT_SOLVERS,
    METHODS,
    Budget,
    Method,
    climb,
    first_rung,
    recall,
)
from ropeode.references.options import ReferenceOptions
from ropeode.references.reference import Reference
from ropeode.references.solvers.solution import Solution
from ropeode.references.witnesses import (
    other_runs,
    rough_path,
    solve_beyond_float64,
    solve_closely,
    solve_independent,
    solve_other,
)

TIGHTEST_RTOL = 1e-14
_PACKAGES = ("ropeode", "diffrax", "jax", "jaxlib", "numpy", "scipy")


Seen = Callable[[Role | Literal["reference"], Solution], object]


@dataclasses.dataclass(eq=False)
class Comparison:
    """The run that becomes the reference, and how far all others are from it.

    Arguments:
        problem: what was to be solved.
        solved: the same up to the last sample that the loosest run reached, or for which the
            time suffices.
        method: the solvers.
        budget: the time that they may take, and have taken.
        run: the run that becomes the reference.
        rungs: all rungs of the tolerance ladder, without their states.
        seen: is called with the role and the states of each run.
        from_tightest: how far each rung is from the tightest one, at most, up to each sample.
        witnesses: the other runs, compared with `run`.
        others: those of them that are not rungs, without their states.
    """

    problem: Problem
    solved: Problem
    method: Method
    budget: Budget
    run: Solution
    rungs: tuple[Solution, ...]
    seen: Seen
    from_tightest: list[np.ndarray] = dataclasses.field(default_factory=list)
    witnesses: list[Witness] = dataclasses.field(default_factory=list)
    others: list[Solution] = dataclasses.field(default_factory=list)

    @property
    def next_tighter(self) -> Solution:
        """The rung of the ladder after the run."""
        return next(rung for rung in self.rungs if rung.rtol < self.run.rtol)

    @property
    def every(self) -> list[Solution]:
        """All runs, without their states."""
        return [*self.rungs, *self.others]

    def add(self, role: Role, run: Solution) -> None:
        """Compare a run."""
        self.seen(role, run)
        self.witnesses.append(witness(self.problem, self.run, run, role))
        if role not in ("looser", "tighter"):
            self.others.append(run.without_states())

    def bounds(self, *more: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """The error bounds that follow from all runs so far; `more` is as for `bounds`."""
        return bounds(self.problem, self.run, self.witnesses, *more)


def _unseen(role: Role | Literal["reference"], run: Solution) -> None:
    """No run is kept."""


def consensus_reference(
    problem: Problem, options: ReferenceOptions, progress: Progress, seen: Seen = _unseen
) -> Reference:
    """A reference of level `consensus`, as `ropeode.reference` describes it and raises.

    Arguments:
        problem: what is solved.
        options: of the reference.
        progress: called before each run, with what it is.
        seen: called after each run, with its role.
    """
    primary = primary_runs(problem, options, progress, seen)
    independent, beyond = independent_run(primary), None
    # Taylor series are an explicit method.
    if primary.method is EXPLICIT_SOLVERS:
        beyond = solve_beyond_float64(problem, primary.solved, primary.run, primary.budget)
    return certified(primary, independent, options, beyond)


def independent_run(primary: Comparison) -> Solution:
    """The run of another library's solver, as far as the primary ones went."""
    return solve_independent(
        primary.solved, primary.method, primary.next_tighter, primary.run, primary.budget
    )


def primary_runs(
    problem: Problem, options: ReferenceOptions, progress: Progress, seen: Seen = _unseen
) -> Comparison:
    """Run the primary solver on its ladder, from a neighbouring state, and with short steps.

    Raises:
        InputError: `atol` does not have the state's shape.
        ReferenceRefused: the ladder is too short, or the time does not suffice.
    """
    rtol = options.rtol
    scale, samples = options.tolerance_scale(problem), len(problem.ts)
    budget = Budget(scale, options.time_limit, progress, samples)
    method, solved, rungs = _ladder(problem, rtol, budget)
    primary_index = len(rungs) - 2 if rtol is None else 2
    if not 0 < primary_index < len(rungs) - 1 or len(rungs[-1].states) < 2:
        last = rungs[-1]
        why = last.failure or "is the tightest run that gains anything; three rungs are needed"
        raise ReferenceRefused(
            f"no reference for {problem.name!r}: {last.solver} at rtol {last.rtol:.0e} "
            f"{why}. Start where the right-hand side is smooth, declare its jump times, sample "
            f"earlier, or ask for a looser rtol."
            f"{hints(problem, rungs[0], rough_path(solved, method, budget), rtol)}",
            Reason.STOPPED,
        )
    primary, tightest = recall(solved, method, rungs[primary_index], budget), rungs[-1]
    seen("reference", primary)
    bare = tuple(rung.without_states() for rung in rungs)
    compared = Comparison(problem, solved, method, budget, primary, bare, seen)
    for index, rung in enumerate(rungs):
        run = primary if index == primary_index else recall(solved, method, rung, budget)
        apart = distances(problem, run.states, tightest.states)[problem.quantities[0]]
        compared.from_tightest.append(np.maximum.accumulate(padded(apart, problem)))
        if index != primary_index:
            compared.add("looser" if index < primary_index else "tighter", run)
        del run
    del rungs, tightest
    for role, more in other_runs(problem, solved, primary):
        compared.add(role, solve_other(solved, method, primary.rtol, role, more, budget))
    return compared


def certified(
    primary: Comparison,
    independent: Solution,
    options: ReferenceOptions,
    beyond: Solution | None = None,
) -> Reference:
    """The reference with its certificate.

    Arguments:
        primary: the runs of the primary solver.
        independent: that of another one.
        options: of the reference.
        beyond: a run with more digits, if there is one.

    Raises:
        ReferenceRefused: not even the first sample can be trusted; says why.
    """
    problem, run, witnesses = primary.problem, primary.run, primary.witnesses
    primary.add("independent", independent)
    if beyond is not None:
        primary.add("more digits", beyond)
    drift = problem.drift(run.states)
    estimated = primary.bounds(drift)
    bound, accuracy = estimated[problem.quantities[0]], options.accuracy
    if accuracy is None:
        moved = _resolved_motion(problem, run.states, bound, independent)
        accuracy = default_accuracy(problem, moved, 1e4 * (options.rtol or 0.0))
    trusted, why = trusted_samples(
        problem, primary.rungs, primary.from_tightest, bound, witnesses, accuracy
    )
    reason = f"{why}: {_first_failure(primary)}" if why == Reason.STOPPED else why
    if trusted < 2:
        unresolved = unresolved_motion(problem, run.states[:2], bound[:2])
        unresolved = f" {unresolved}" if unresolved and np.isfinite(bound[1]) else ""
        raise ReferenceRefused(
            f"no reference for {problem.name!r}: at t = {problem.ts[1]:g} already {reason} (bound "
            f"{bound[1]:.1e}, accuracy {accuracy:.1e}). "
            "Ask for less accuracy, declare jump times if the right-hand side has jumps, "
            f"or see whether it is smooth and in float64.{unresolved}"
            f"{hints(problem, primary.rungs[0], independent.path, options.rtol)}",
            why,
            witnesses,
        )
    inside = problem.until(trusted)
    assert independent.path is not None
    path = independent.path.until(inside.ts[-1])
    findings = look_between(inside, path, estimated, progress=primary.budget.progress)
    if findings.unresolved:
        estimated = primary.bounds(drift, findings.unresolved)
        bound = estimated[problem.quantities[0]]
        seen = int(np.argmin(np.append(bound[:trusted] <= accuracy, False)))
        if seen < trusted:
            trusted, reason = seen, Reason.COARSE
        if trusted < 2:
            raise ReferenceRefused(f"no reference for {problem.name!r}: {reason}.", reason)
    if len(findings.times):
        closer = solve_closely(inside, primary.method, independent, findings, primary.budget)
        primary.add("close look", closer)
        before = estimated
        estimated = primary.bounds(drift, findings.unresolved)
        bound, apart = estimated[problem.quantities[0]], witnesses[-1].differences
        seen = findings.trusted(inside.ts, apart, before, bound, accuracy)
        if seen < trusted:
            trusted, reason = seen, findings.reason(problem.ts[seen - 1], problem.ts[seen])
        if trusted < 2:
            raise ReferenceRefused(
                f"no reference for {problem.name!r}: {reason}.", reason, witnesses
            )
    estimated = unknown_beyond(estimated, trusted, accuracy)
    if trusted < len(problem.ts) and (coarse := coarse_times(problem, run.steps, run.reached)):
        reason = f"{reason}. {coarse.rstrip('.')}"
    return Reference(
        problem=problem,
        states=run.states,
        certificate=Certificate(
            level="consensus",
            solver=run.solver,
            rtol=run.rtol,
            atol=run.atol,
            steps=run.steps,
            accuracy=accuracy,
            bounds=estimated,
            drift=drift,
            trusted=trusted,
            horizon=float(problem.ts[trusted]) if trusted < len(problem.ts) else None,
            horizon_reason=reason,
            witnesses=tuple(_inside(w, problem, trusted) for w in witnesses),
            stiff=primary.method is not EXPLICIT_SOLVERS,
            seconds=sum(each.seconds for each in primary.every),
            compile_seconds=sum(each.compile_seconds for each in primary.every),
            versions=versions(*_PACKAGES, *(["heyoka"] if beyond else [])),
            sampling=findings.sampling,
        ),
    )


def _first_failure(primary: Comparison) -> str:
    """Why a run ended before the others."""
    failures = [f"{run.solver} {run.failure}" for run in primary.every if run.failure]
    return failures[0] if failures else f"the time limit of {primary.budget.seconds:g} s is spent"


def _resolved_motion(
    problem: Problem, states: np.ndarray, bound: np.ndarray, independent: Solution
) -> float:
    """The motion up to the last sample at which the bound leaves it three digits.

    Past a pole it has none. What comes back at each sample has moved between them.
    """
    farthest, path = motion(problem, states), independent.path
    assert path is not None
    between = motion(problem, path.states.reshape(-1, *problem.y0.shape))
    last = np.searchsorted(path.times, problem.ts[: len(states)], side="right") - 1
    farthest = np.maximum(farthest, between[last])
    resolved = np.append(bound[: len(farthest)] <= 1e-3 * farthest, False)
    return float(farthest[max(int(np.argmin(resolved)) - 1, 0)])


def _ladder(
    problem: Problem, rtol: float | None, budget: Budget
) -> tuple[Method, Problem, list[Solution]]:
    """The method that fits the problem, how much of it is solved, and the ladder."""

    def tolerances(method: Method) -> list[float]:
        if rtol is None:
            return list(method.tolerances)
        around = [100 * rtol, 10 * rtol, rtol, rtol / 10, rtol / 100]
        return [tolerance for tolerance in around if tolerance > 0.99 * TIGHTEST_RTOL]

    ladders = {method: tolerances(method) for method in METHODS}
    method, solved, first = first_rung(problem, ladders, budget)
    return method, *climb(solved, method, first, ladders[method][1:], budget)


def _inside(w: Witness, problem: Problem, trusted: int) -> Witness:
    """A witness with its largest difference inside the horizon filled in."""
    differences = w.differences[problem.quantities[0]][:trusted]
    return dataclasses.replace(w, difference=float(np.max(differences)))
