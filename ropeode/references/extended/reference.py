"""References from extended precision, with a certificate of level `extended`."""

from __future__ import annotations

import numpy as np

from ropeode.errors import ReferenceRefused
from ropeode.norms import motion
from ropeode.problems.problem import Problem
from ropeode.progress import Progress
from ropeode.references.certificate import (
    Certificate,
    Witness,
    default_accuracy,
    distances,
    padded,
    versions,
)
from ropeode.references.consensus import consensus_reference
from ropeode.references.extended.solution import ExtendedSolution, extended_solution
from ropeode.references.options import ReferenceOptions
from ropeode.references.reference import Reference
from ropeode.references.solvers.solver import taylor
from ropeode.validation import bad_value

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
    other = _consensus(problem, accuracy, progress)
    apart = distances(problem, states, other.states[: other.trusted]) if other else {}
    contradicted_at = _contradiction(apart[first], bounds[first], other) if other else trusted
    if other and contradicted_at < trusted:
        raise ReferenceRefused(
            f"no extended reference for {problem.name!r}: from t = {problem.ts[contradicted_at]:g} "
            f"on it is further from that of float64 solvers ({other.certificate.solver}) than the "
            "two bounds allow. One of them has stepped over something: declare jump times, or "
            "sample where the right-hand side changes fast."
        )
    if trusted < 2:
        raise ReferenceRefused(
            f"no extended reference for {problem.name!r}: the bound at t = {problem.ts[1]:g} is "
            f"{bounds[problem.quantities[0]][1]:.1e}, and the accuracy asked for {accuracy:.1e}. "
            "Ask for less accuracy."
        )
    reason = None
    if trusted < len(problem.ts):
        short = trusted == solution.agreed
        reason = solution.failure if short else "the estimated bound exceeds the accuracy asked for"
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
            bounds=bounds,
            drift=drift,
            trusted=trusted,
            horizon=float(problem.ts[trusted]) if trusted < len(problem.ts) else None,
            horizon_reason=reason,
            witnesses=(
                _witness(problem, solution, trusted),
                *([_independent(problem, other, apart)] if other else []),
            ),
            stiff=False,
            seconds=solution.seconds,
            compile_seconds=solution.coarse.compile_seconds + solution.fine.compile_seconds,
            versions=versions(*_PACKAGES),
        ),
    )


def _consensus(problem: Problem, accuracy: float, progress: Progress) -> Reference | None:
    """The reference of float64 solvers, which take short steps too; None if there is none.

    The two runs in extended precision use one method, and step over a narrow pulse alike.
    """
    try:
        return consensus_reference(problem, ReferenceOptions(accuracy=accuracy), progress)
    except ReferenceRefused:
        return None


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


def _witness(problem: Problem, solution: ExtendedSolution, trusted: int) -> Witness:
    """The coarser run, with its distance from the finer one before either is rounded."""
    differences = {
        quantity: padded(series, problem) for quantity, series in solution.differences.items()
    }
    return Witness(
        solver=taylor(solution.coarse.precision),
        tolerance=solution.coarse.tolerance,
        role="fewer digits",
        steps=solution.coarse.steps,
        seconds=solution.coarse.seconds,
        differences=differences,
        difference=float(np.max(differences[problem.quantities[0]][:trusted])),
    )


def _with_drift(bound: np.ndarray, drift: np.ndarray | None) -> np.ndarray:
    return bound if drift is None else np.maximum.accumulate(np.maximum(bound, drift))
