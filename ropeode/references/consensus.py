"""References of level `consensus`: float64 runs of two kinds of solvers that agree."""

from __future__ import annotations

import dataclasses

import numpy as np

from ropeode.errors import ReferenceRefused
from ropeode.norms import motion
from ropeode.problems.problem import Problem
from ropeode.progress import Progress
from ropeode.references.certificate import (
    Certificate,
    Reason,
    Witness,
    bounds,
    default_accuracy,
    distances,
    padded,
    trusted_samples,
    versions,
    witness,
)
from ropeode.references.defect import look_between
from ropeode.references.ladder import (
    EXPLICIT,
    IMPLICIT,
    Method,
    climb,
    other_runs,
    recall,
    short_steps,
    solve_closely,
    solve_independent,
    solve_other,
    solve_primary,
    step_budget,
)
from ropeode.references.options import ReferenceOptions
from ropeode.references.reference import Reference
from ropeode.references.solvers.solution import Solution

TIGHTEST_RTOL = 1e-14
_PACKAGES = ("ropeode", "diffrax", "jax", "jaxlib", "numpy", "scipy")


@dataclasses.dataclass(frozen=True, eq=False)
class Primary:
    """All runs of the primary solver on a problem.

    Arguments:
        problem: what was solved.
        method: the solvers.
        run: the run that becomes the reference.
        next_tighter: the rung of the ladder after it, without its states.
        rungs: all rungs of the tolerance ladder, without their states.
        from_tightest: how far each rung is from the tightest one, at most, up to each sample.
        witnesses: the other runs, compared with `run`.
        others: the witnesses that are not rungs, without their states.
    """

    problem: Problem
    method: Method
    run: Solution
    next_tighter: Solution
    rungs: tuple[Solution, ...]
    from_tightest: tuple[np.ndarray, ...]
    witnesses: tuple[Witness, ...]
    others: tuple[Solution, ...]


def consensus_reference(
    problem: Problem, options: ReferenceOptions, progress: Progress
) -> Reference:
    """A reference of level `consensus`, as `ropeode.reference` describes it and raises."""
    primary = primary_runs(problem, options.rtol, progress)
    independent = solve_independent(
        problem, primary.method, primary.next_tighter, primary.run, progress
    )
    # Not above: heyoka is an extra.
    from ropeode.references.extended.witness import run_beyond_float64

    beyond = None
    # Taylor series are an explicit method.
    if primary.method is EXPLICIT:
        longest = short_steps(problem, problem.ts)
        beyond = run_beyond_float64(problem, primary.run, longest, progress)
    return certified(primary, independent, options, progress, beyond)


def primary_runs(problem: Problem, rtol: float | None, progress: Progress) -> Primary:
    """Run the primary solver on its ladder, from a neighbouring state, and with short steps.

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
            "earlier, or ask for a looser rtol.",
            Reason.STOPPED,
        )
    primary, tightest = recall(problem, method, rungs[primary_index], progress), rungs[-1]
    witnesses, from_tightest = [], []
    for index, rung in enumerate(rungs):
        run = primary if index == primary_index else recall(problem, method, rung, progress)
        apart = distances(problem, run.states, tightest.states)[problem.quantities[0]]
        from_tightest.append(np.maximum.accumulate(padded(apart, problem)))
        if index != primary_index:
            role = "looser" if index < primary_index else "tighter"
            witnesses.append(witness(problem, primary, run, role))
        del run
    bare_rungs = tuple(rung.without_states() for rung in rungs)
    del rungs, tightest
    others = []
    for role, options in other_runs(problem, problem, primary):
        run = solve_other(problem, method, primary.rtol, role, options, progress)
        witnesses.append(witness(problem, primary, run, role))
        others.append(run.without_states())
    return Primary(
        problem=problem,
        method=method,
        run=primary,
        next_tighter=bare_rungs[primary_index + 1],
        rungs=bare_rungs,
        from_tightest=tuple(from_tightest),
        witnesses=tuple(witnesses),
        others=tuple(others),
    )


def certified(
    primary: Primary,
    independent: Solution,
    options: ReferenceOptions,
    progress: Progress,
    beyond: Solution | None = None,
) -> Reference:
    """The reference with its certificate.

    Arguments:
        primary: the runs of the primary solver.
        independent: that of another one.
        options: of the reference.
        progress: called before a run that looks closely.
        beyond: a run with more digits, if there is one.

    Raises:
        ReferenceRefused: not even the first sample can be trusted; says why.
    """
    problem, run = primary.problem, primary.run
    witnesses = [*primary.witnesses, witness(problem, run, independent, "independent")]
    every = [*primary.rungs, *primary.others, independent]
    if beyond is not None:
        witnesses.append(witness(problem, run, beyond, "more digits"))
        every.append(beyond)
    drift = problem.drift(run.states)
    estimated = bounds(problem, run, witnesses, drift)
    bound, accuracy = estimated[problem.quantities[0]], options.accuracy
    if accuracy is None:
        moved = _resolved_motion(problem, run.states, bound)
        accuracy = default_accuracy(problem, moved, 1e4 * (options.rtol or 0.0))
    trusted, reason = trusted_samples(
        problem, primary.rungs, primary.from_tightest, bound, witnesses, accuracy
    )
    if trusted < 2:
        failures = "; ".join(f"{each.solver} {each.failure}" for each in every if each.failure)
        raise ReferenceRefused(
            f"no reference for {problem.name!r}: at t = {problem.ts[1]:g} already {reason} (bound "
            f"{bound[1]:.1e}, accuracy {accuracy:.1e}"
            + (f"; {failures}" if failures else "")
            + "). Ask for less accuracy, declare jump times if the right-hand side has jumps, "
            "or see whether it is smooth and in float64.",
            reason,
            witnesses,
        )
    inside = problem.until(trusted)
    assert independent.path is not None
    findings = look_between(inside, independent.path.until(inside.ts[-1]), estimated)
    if len(findings.times):
        closer = solve_closely(inside, primary.method, independent, findings, progress)
        witnesses.append(witness(problem, run, closer, "close look"))
        every.append(closer)
        before, estimated = estimated, bounds(problem, run, witnesses, drift)
        bound, apart = estimated[problem.quantities[0]], witnesses[-1].differences
        seen = findings.trusted(inside.ts, apart, before, bound, accuracy)
        if seen < trusted:
            trusted, reason = seen, findings.reason(problem.ts[seen - 1], problem.ts[seen])
        if trusted < 2:
            raise ReferenceRefused(
                f"no reference for {problem.name!r}: {reason}.", reason, witnesses
            )
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
            stiff=primary.method is IMPLICIT,
            seconds=sum(each.seconds for each in every),
            compile_seconds=sum(each.compile_seconds for each in every),
            versions=versions(*_PACKAGES, *(["heyoka"] if beyond else [])),
            sampling=findings.sampling,
        ),
    )


def _resolved_motion(problem: Problem, states: np.ndarray, bound: np.ndarray) -> float:
    """The motion up to the last sample at which the bound leaves it three digits.

    Past a pole it has none.
    """
    farthest = motion(problem, states)
    resolved = np.append(bound[: len(farthest)] <= 1e-3 * farthest, False)
    return float(farthest[max(int(np.argmin(resolved)) - 1, 0)])


def _ladder(
    problem: Problem, rtol: float | None, progress: Progress
) -> tuple[Method, list[Solution]]:
    """The ladder of the method that fits the problem: explicit if it gets anywhere."""

    def tolerances(method: Method) -> list[float]:
        if rtol is None:
            return list(method.tolerances)
        around = [100 * rtol, 10 * rtol, rtol, rtol / 10, rtol / 100]
        return [tolerance for tolerance in around if tolerance > 0.99 * TIGHTEST_RTOL]

    method = EXPLICIT
    first = solve_primary(problem, method, tolerances(method)[0], progress)
    if first.failure and first.steps >= step_budget(problem):
        other = solve_primary(problem, IMPLICIT, tolerances(IMPLICIT)[0], progress)
        if len(other.states) > len(first.states):
            method, first = IMPLICIT, other
    return method, climb(problem, method, first, tolerances(method)[1:], progress)


def _inside(w: Witness, problem: Problem, trusted: int) -> Witness:
    """A witness with its largest difference inside the horizon filled in."""
    differences = w.differences[problem.quantities[0]][:trusted]
    return dataclasses.replace(w, difference=float(np.max(differences)))
