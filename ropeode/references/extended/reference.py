"""References from extended precision, with a certificate of level `extended`."""

from __future__ import annotations

import platform
from importlib import metadata

import numpy as np

from ropeode.errors import InputError, ReferenceRefused
from ropeode.norms import distance
from ropeode.problems.problem import Problem
from ropeode.references.certificate import Certificate, Witness, largest_norms, padded
from ropeode.references.extended.solution import ExtendedSolution, extended_solution
from ropeode.references.ladder import Progress
from ropeode.references.reference import (
    FINEST_ACCURACY,
    RELATIVE_ACCURACY,
    Reference,
    motion,
    reference,
)
from ropeode.validation import check_positive, complaint

_PACKAGES = ("ropeode", "heyoka", "jax", "jaxlib", "numpy")


def extended_reference(
    problem: Problem,
    accuracy: float | None,
    rtol: float | None,
    *,
    digits: int,
    time_limit: float,
    progress: Progress,
) -> Reference:
    """A reference whose values are the solution, rounded to float64.

    Arguments:
        problem: what to solve.
        accuracy: as for `ropeode.reference`.
        rtol: there is none to choose.
        digits: as for `extended_solution`.
        time_limit: in seconds, as for `extended_solution`.
        progress: called with a few words before each run.

    Raises:
        InputError: an argument cannot be used, the right-hand side cannot be translated, or
            heyoka is missing.
        ReferenceRefused: not even the first sample is known so well.
    """
    if rtol is not None:
        fix = "leave it out, or ask for digits"
        raise InputError(complaint("rtol", rtol, "none with level 'extended'", fix))
    if accuracy is not None:
        accuracy = check_positive("accuracy", accuracy, example="1e-6")
    found = extended_solution(problem, digits=digits, time_limit=time_limit, progress=progress)
    if found.agreed < 2:
        why = found.failure or "two runs in extended precision do not agree"
        raise ReferenceRefused(
            f"no extended reference for {problem.name!r}: {why}. Ask for fewer frames or digits, "
            "or allow more time (time_limit)."
        )
    states = found.states[: found.agreed]
    if accuracy is None:
        farthest = float(motion(problem, states)[-1])
        accuracy = max(RELATIVE_ACCURACY * farthest, FINEST_ACCURACY * problem.scale)
    drift = problem.drift(states)
    bounds = {
        quantity: padded(_with_drift(series[: found.agreed], drift.get(quantity)), problem)
        for quantity, series in found.bounds.items()
    }
    first = problem.quantities[0]
    within = bounds[first] <= accuracy
    trusted = int(np.argmin(np.append(within, False)))
    other = _consensus(problem, accuracy, progress)
    apart = _distances(problem, states, other) if other else {}
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
        short = trusted == found.agreed
        reason = found.failure if short else "the estimated bound exceeds the accuracy asked for"
    return Reference(
        problem=problem,
        states=states,
        certificate=Certificate(
            level="extended",
            solver=_solver(found.fine.precision),
            rtol=found.fine.tolerance,
            atol=0.0,
            steps=found.fine.steps,
            accuracy=accuracy,
            bounds=bounds,
            drift=drift,
            trusted=trusted,
            horizon=float(problem.ts[trusted]) if trusted < len(problem.ts) else None,
            horizon_reason=reason,
            witnesses=(
                _witness(problem, found, trusted),
                *([_independent(problem, other, apart)] if other else []),
            ),
            stiff=False,
            seconds=found.seconds,
            compile_seconds=found.coarse.compile_seconds + found.fine.compile_seconds,
            versions={name: metadata.version(name) for name in _PACKAGES}
            | {"python": platform.python_version()},
        ),
    )


def _consensus(problem: Problem, accuracy: float, progress: Progress) -> Reference | None:
    """The reference of float64 solvers, which take short steps too; None if there is none.

    The two runs in extended precision are of one method, and step over a narrow pulse alike.
    """
    try:
        return reference(problem, accuracy, progress=progress)
    except ReferenceRefused:
        return None


def _distances(problem: Problem, states: np.ndarray, other: Reference) -> dict[str, np.ndarray]:
    """How far the other reference is, for each quantity at each sample that both have."""
    return {
        quantity: distance(problem, norm, states, other.states[: other.trusted])
        for quantity, norm in largest_norms(problem).items()
    }


def _contradiction(apart: np.ndarray, bound: np.ndarray, other: Reference) -> int:
    """The first sample at which two references are further apart than their bounds allow."""
    too_far = apart > bound[: len(apart)] + other.bound()[: len(apart)]
    return int(np.argmax(np.append(too_far, True))) if np.any(too_far) else len(bound)


def _independent(problem: Problem, other: Reference, apart: dict[str, np.ndarray]) -> Witness:
    """The other reference as a witness, as far as it is trusted."""
    made = other.certificate
    return Witness(
        solver=made.solver,
        tolerance=made.rtol,
        role="independent",
        steps=made.steps,
        seconds=made.seconds,
        differences={quantity: padded(series, problem) for quantity, series in apart.items()},
        difference=float(np.max(apart[problem.quantities[0]])),
    )


def _witness(problem: Problem, found: ExtendedSolution, trusted: int) -> Witness:
    """The coarser run, as far from the finer one as they are before anything is rounded."""
    differences = {
        quantity: padded(series, problem) for quantity, series in found.differences.items()
    }
    return Witness(
        solver=_solver(found.coarse.precision),
        tolerance=found.coarse.tolerance,
        role="fewer digits",
        steps=found.coarse.steps,
        seconds=found.coarse.seconds,
        differences=differences,
        difference=float(np.max(differences[problem.quantities[0]][:trusted])),
    )


def _solver(bits: int) -> str:
    return f"heyoka Taylor, {bits} bits"


def _with_drift(bound: np.ndarray, drift: np.ndarray | None) -> np.ndarray:
    return bound if drift is None else np.maximum.accumulate(np.maximum(bound, drift))
