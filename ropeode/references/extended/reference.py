"""References from extended precision, with a certificate of level `extended`."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np

from ropeode.errors import ReferenceRefused
from ropeode.norms import motion
from ropeode.problems import Problem
from ropeode.progress import Progress
from ropeode.references.certificate import (
    SAFETY_FACTOR,
    Certificate,
    Reason,
    Role,
    Witness,
    default_accuracy,
    distances,
    padded,
    unknown_beyond,
    versions,
)
from ropeode.references.consensus import consensus_reference
from ropeode.references.defect import look_between
from ropeode.references.extended.solution import extended_solution
from ropeode.references.extended.taylor import ExtendedRun, solve
from ropeode.references.options import ReferenceOptions
from ropeode.references.reference import Reference
from ropeode.references.solvers.solver import taylor
from ropeode.validation import bad_value

# Groups of runs are so many times further apart than one run is from the next, in the median.
_GROUPED = 1000.0
# Runs that are apart for reasons of their own: looser rungs pass by what the reference has seen,
# the neighbour leaves an unstable balance, moved roundings show what a right-hand side cancels.
_OF_THEIR_OWN = ("looser", "neighbour", "rounding")
# Fewer runs form no groups.
_FEWEST = 5
_PARTED = "some float64 solvers see something there that others pass by"
_PACKAGES = ("ropeode", "heyoka", "jax", "jaxlib", "numpy")


def extended_reference(
    problem: Problem, options: ReferenceOptions, progress: Progress
) -> Reference:
    """A reference whose values are the solution, rounded to float64.

    Raises:
        InputError: the right-hand side cannot be translated, or heyoka is missing.
        ReferenceRefused: not even the first sample is that accurate.
    """
    if problem.in_python:
        allowed = f"'consensus' for {problem.name!r}, whose right-hand side runs in Python"
        raise bad_value("level", "extended", allowed, "write it with jax.numpy")
    solution = extended_solution(
        problem, digits=options.digits, time_limit=options.time_limit, progress=progress
    )
    if solution.agreed < 2:
        why = solution.failure or "two runs in extended precision do not agree"
        raise ReferenceRefused(
            f"no extended reference for {problem.name!r}: {why}. Ask for fewer frames or digits, "
            "or allow more time (time_limit)."
        )
    states, accuracy = solution.states[: solution.agreed], options.accuracy
    if accuracy is None:
        accuracy = default_accuracy(problem, float(motion(problem, states)[-1]))
    drift = problem.drift(states)
    bounds = {
        quantity: padded(_with_drift(series[: solution.agreed], drift.get(quantity)), problem)
        for quantity, series in solution.bounds.items()
    }
    first = problem.quantities[0]
    within = bounds[first] <= accuracy
    trusted = int(np.argmin(np.append(within, False)))
    evidence = _consensus(problem, accuracy, progress)
    other = evidence.reference
    apart = distances(problem, states, other.states[: other.trusted]) if other else {}
    contradicted_at = _contradiction(apart[first], bounds[first], other) if other else trusted
    if other and contradicted_at < trusted:
        raise ReferenceRefused(
            f"no extended reference for {problem.name!r}: from t = {problem.ts[contradicted_at]:g} "
            f"on it is further from that of float64 solvers ({other.certificate.solver}) than the "
            "two bounds allow. One of them has stepped over something: declare jump times, or "
            "sample where the right-hand side changes fast."
        )
    unexplained_at = evidence.unexplained_at(problem, states)
    if min(trusted, unexplained_at) < 2:
        why = (
            f"the bound at t = {problem.ts[1]:g} is {bounds[first][1]:.1e}, and the accuracy asked "
            f"for {accuracy:.1e}. Ask for less accuracy"
            if trusted < 2
            else f"{_PARTED}, already at t = {problem.ts[1]:g}. Declare jump times, or sample "
            "where the right-hand side changes fast"
        )
        raise ReferenceRefused(f"no extended reference for {problem.name!r}: {why}.")
    reason = None
    if unexplained_at < trusted:
        trusted, reason = unexplained_at, _PARTED
    elif trusted < len(problem.ts):
        short = trusted == solution.agreed
        reason = solution.failure if short else Reason.INACCURATE
    inside = problem.until(trusted)
    fine = solution.fine
    assert fine.path is not None
    assert fine.defects is not None
    looks = [fine.defects.look(inside, solution.differences)]
    findings = look_between(inside, fine.path.until(inside.ts[-1]), bounds, looks, progress)
    closer = []
    if len(findings.times):
        run = solve(
            inside,
            precision=solution.coarse.precision,
            time_limit=options.time_limit,
            stops=np.union1d(inside.ts, findings.stops),
            progress=progress,
        )
        differences = {
            quantity: padded(series, problem)
            for quantity, series in distances(problem, run.rounded, states).items()
        }
        before = bounds
        bounds = {
            quantity: np.maximum.accumulate(before[quantity] + SAFETY_FACTOR * series)
            for quantity, series in differences.items()
        }
        seen = findings.trusted(inside.ts, differences, before, bounds[first], accuracy)
        if seen < trusted:
            trusted, reason = seen, findings.reason(problem.ts[seen - 1], problem.ts[seen])
        if trusted < 2:
            raise ReferenceRefused(f"no extended reference for {problem.name!r}: {reason}.")
        closer = [_witness(problem, run, "close look", differences, trusted)]
    return Reference(
        problem=problem,
        states=states,
        certificate=Certificate(
            level="extended",
            solver=taylor(solution.fine.precision),
            rtol=solution.fine.tolerance,
            atol=0.0,
            steps=solution.fine.steps,
            accuracy=accuracy,
            bounds=unknown_beyond(bounds, trusted, accuracy),
            drift=drift,
            trusted=trusted,
            horizon=float(problem.ts[trusted]) if trusted < len(problem.ts) else None,
            horizon_reason=reason,
            witnesses=(
                _witness(problem, solution.coarse, "fewer digits", solution.differences, trusted),
                *([_independent(problem, other, apart)] if other else []),
                *closer,
            ),
            stiff=False,
            seconds=solution.seconds,
            compile_seconds=solution.coarse.compile_seconds + solution.fine.compile_seconds,
            versions=versions(*_PACKAGES),
            sampling=findings.sampling,
        ),
    )


@dataclasses.dataclass(frozen=True)
class _Evidence:
    """What float64 solvers, which take short steps too, say of a problem.

    The two runs in extended precision use one method, and step over a narrow pulse alike.

    Arguments:
        reference: theirs, up to its horizon; None if they have none.
        reason: why it ends, or why there is none; None if it goes to the end.
        witnesses: the runs it rests on.
    """

    reference: Reference | None
    reason: str | None
    witnesses: tuple[Witness, ...]

    def unexplained_at(self, problem: Problem, states: np.ndarray) -> int:
        """The first sample at which one run has seen something that another has not.

        Where float64 loses its digits to chaos, each run goes a way of its own, so that their
        distances from the reference are all different. Extended precision is there for that.
        Where they fall into groups instead, those that have seen something and those that have
        passed it by, the distance between the groups is much larger than those within. Where a
        run ends for want of steps or of time, it says nothing.

        Arguments:
            problem: what was solved.
            states: of the extended reference.

        Returns:
            An index of a sample; more than the last one if there is no such sample.
        """
        if self.reason and self.reason.startswith(Reason.UNSETTLED):
            return 1 if self.reference is None else self.reference.trusted
        quantity, beyond = problem.quantities[0], len(problem.ts)
        size = np.maximum.accumulate(np.abs(problem.quantity(quantity, states)).max(axis=(1, 2)))
        size = np.maximum(size, problem.scale)
        apart = np.array([run.differences[quantity][: len(states)] for run in self.witnesses])
        spread = np.zeros(len(states))
        for k, row in enumerate(apart.T):
            # The reference itself is at 0.
            ways = np.sort(np.append(row[np.isfinite(row)], 0.0))
            spread[k] = np.median(np.diff(ways)) if len(ways) >= _FEWEST else np.inf
        spread = np.maximum.accumulate(spread)
        for run, series in zip(self.witnesses, apart, strict=True):
            if run.role not in _OF_THEIR_OWN:
                in_each_step = run.tolerance * run.steps * size
                parted = np.isfinite(series) & (
                    series > _GROUPED * np.maximum(spread, in_each_step)
                )
                beyond = min(beyond, int(np.argmax(np.append(parted, True))))
        return beyond if beyond < len(states) else len(problem.ts)


def _consensus(problem: Problem, accuracy: float, progress: Progress) -> _Evidence:
    """The evidence of the float64 solvers."""
    try:
        found = consensus_reference(problem, ReferenceOptions(accuracy=accuracy), progress)
    except ReferenceRefused as refused:
        return _Evidence(None, refused.reason, refused.witnesses)
    certificate = found.certificate
    return _Evidence(found, certificate.horizon_reason, certificate.witnesses)


def _contradiction(apart: np.ndarray, bound: np.ndarray, other: Reference) -> int:
    """The first sample at which two references are further apart than their bounds allow."""
    too_far = apart > bound[: len(apart)] + other.bound()[: len(apart)]
    return int(np.argmax(too_far)) if np.any(too_far) else len(bound)


def _independent(problem: Problem, other: Reference, apart: dict[str, np.ndarray]) -> Witness:
    """The other reference as a witness, up to its horizon."""
    certificate = other.certificate
    return Witness(
        solver=certificate.solver,
        tolerance=certificate.rtol,
        role="independent",
        steps=certificate.steps,
        seconds=certificate.seconds,
        differences={quantity: padded(series, problem) for quantity, series in apart.items()},
        difference=float(np.max(apart[problem.quantities[0]])),
    )


def _witness(
    problem: Problem,
    run: ExtendedRun,
    role: Role,
    apart: Mapping[str, np.ndarray],
    trusted: int,
) -> Witness:
    """A run, with its distance from the reference."""
    return Witness(
        solver=taylor(run.precision),
        tolerance=run.tolerance,
        role=role,
        steps=run.steps,
        seconds=run.seconds,
        differences={quantity: padded(series, problem) for quantity, series in apart.items()},
        difference=float(np.max(apart[problem.quantities[0]][:trusted])),
    )


def _with_drift(bound: np.ndarray, drift: np.ndarray | None) -> np.ndarray:
    return bound if drift is None else np.maximum.accumulate(np.maximum(bound, drift))
