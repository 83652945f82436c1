"""Dense output: where its nodes go and how accurate it is, both by measurement.

The solver of the reference runs once more, with steps that end on the nodes and on points between
them. A piece is split until its polynomial is close enough to those points. Then the witnesses run
once more, with steps that end there too, and are compared with the polynomials as the
certificate compares them with the samples. So the bound between the samples means the same as the
certificate's; it includes how an orbit's error grows on the way through its pericentre.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator
from typing import Any, get_args

import numpy as np

from ropeode.errors import ReferenceRefused
from ropeode.norms import distance
from ropeode.problems import Problem
from ropeode.progress import Progress, silent
from ropeode.references.certificate import (
    ROUNDING_UNITS,
    Level,
    Role,
    bounds,
    largest_norms,
    witness,
)
from ropeode.references.dense.polynomials import Dense, time_derivatives
from ropeode.references.ladder import solve_primary
from ropeode.references.options import TIME_LIMIT
from ropeode.references.reference import Reference
from ropeode.references.solvers.solution import Solution
from ropeode.references.witnesses import budget_of, method_of, witness_runs

# Order 10. More cost more to compile than they save.
_MOST_DERIVATIVES = 4
# The part of the bound that the polynomials may add, so that it need not grow by much.
_SHARE = 0.1
# Where a piece is tested: the leading term of its error is largest in the middle.
_FRACTIONS = (0.22, 0.5, 0.71)
# Where a pass divides the largest error by less than the first number, the error counts as
# rounding if it is at most the second number times what is allowed.
_LEAST_GAIN = 8.0
_ROUNDING: dict[Level, float] = {"consensus": 10.0, "extended": 1000.0}
# Steps of an order-8 method that one piece replaces, to begin with.
_STEPS_PER_PIECE = 4
_MOST_PARTS = 8
# So that few programs have to be compiled: one for each number of tested times.
_FEWEST_TIMES = 128
_MOST_PASSES = 16
_MOST_NODES = 8192
_MOST_NODES_PER_FRAME = 16
_MOST_BYTES = 2**28

# One more run of the reference's own solver, and the runs of its witnesses.
Primary = Callable[[Problem], Solution]
Witnesses = Callable[[Problem, Solution], Iterator[tuple[Role, Solution]]]


def with_dense_output(
    reference: Reference,
    *,
    time_limit: float = TIME_LIMIT,
    progress: Progress = silent,
) -> Reference:
    """The same reference, with states at all times inside its trust horizon.

    Arguments:
        reference: it may come from a file.
        time_limit: in seconds, for each run in extended precision, or for all runs in float64.
        progress: called before each run, with what it is.

    Raises:
        InputError: the reference is of level `extended`, and heyoka is missing.
        ReferenceRefused: the bound between the first samples exceeds the accuracy, or the
            solver does not reach the end when its steps end on the nodes.
    """
    if reference.certificate.level == "extended":
        primary, witnesses = _extended_runs(reference, time_limit, progress)
    else:
        primary, witnesses = _float64_runs(reference, time_limit, progress)
    dense, refined, run = _fine_enough(reference, primary)
    dense = _through_the_samples(reference, dense)
    polynomial = dataclasses.replace(run, states=dense.at(refined.ts))
    compared = [
        witness(refined, polynomial, other, role) for role, other in witnesses(refined, run)
    ]
    estimated = bounds(refined, polynomial, compared, refined.drift(polynomial.states))
    at = np.searchsorted(refined.ts, dense.times)
    measured = {
        quantity: np.maximum(series[at], _certified(reference, quantity, dense.times))
        for quantity, series in estimated.items()
    }
    first, accuracy = measured[reference.problem.quantities[0]], reference.certificate.accuracy
    trusted = int(np.argmin(np.append(first <= accuracy, False)))
    if trusted < 2:
        raise ReferenceRefused(
            f"no dense output for {reference.problem.name!r}: the bound is {first[1]:.1e} already "
            f"before t = {dense.times[1]:g}, and the accuracy {accuracy:.1e}. Ask for less "
            "accuracy, or for more samples."
        )
    whole = dataclasses.replace(dense, bounds=measured)
    return dataclasses.replace(reference, dense=whole.until(float(dense.times[trusted - 1])))


def _fine_enough(reference: Reference, primary: Primary) -> tuple[Dense, Problem, Solution]:
    """Polynomials with nodes close enough, as far as the limit on their number allows.

    Returns:
        The polynomials without bounds, the problem with samples on the nodes and between them,
        and the run that stopped there.
    """
    problem, samples = reference.problem, reference.times[: reference.trusted]
    most = max(_MOST_NODES, _MOST_NODES_PER_FRAME * len(samples))
    most = min(most, _MOST_BYTES // ((1 + _MOST_DERIVATIVES) * problem.y0.nbytes))
    jumps = tuple(jump for jump in problem.jump_times if jump < samples[-1])
    parts = reference.certificate.steps // (_STEPS_PER_PIECE * problem.frames)
    # Short steps may serve stability, as in stiff problems, where few pieces suffice.
    parts = min(max(1, parts), _MOST_PARTS)
    nodes = np.union1d(_split(samples, np.full(len(samples) - 1, parts)), jumps)
    before = np.inf
    for _ in range(_MOST_PASSES):
        refined = dataclasses.replace(problem, ts=_tested_times(nodes), jump_times=jumps)
        run = primary(refined)
        if len(run.states) < len(refined.ts):
            why = f"{run.solver} {run.failure}"
            raise ReferenceRefused(f"no dense output for {problem.name!r}: {why}.")
        dense, excess = _best(reference, nodes, refined, run)
        worst = np.max(excess)
        # What hardly falls any more is rounding, also that of the states in the derivatives.
        if worst <= 1.0 or before / _LEAST_GAIN < worst <= _ROUNDING[reference.certificate.level]:
            break
        parts = np.ceil(1.1 * np.minimum(excess, 1e300) ** (1 / dense.order))
        parts = np.where(excess > 1.0, np.clip(parts, 2, _MOST_PARTS), 1)
        finer = _split(nodes, parts.astype(int))
        if len(finer) == len(nodes) or len(finer) > most:
            break
        nodes, before = finer, worst
    return dense, refined, run


def _through_the_samples(reference: Reference, dense: Dense) -> Dense:
    """The polynomials with the reference's own states at the samples, and derivatives there."""
    sampled = np.isin(dense.times, reference.times)
    times = dense.times[sampled]
    states = reference.states[np.searchsorted(reference.times, times)]
    derivatives = dense.derivatives.copy()
    at_samples = time_derivatives(reference.problem, times, states, _MOST_DERIVATIVES)
    derivatives[sampled] = at_samples[:, : derivatives.shape[1]]
    return dataclasses.replace(dense, derivatives=derivatives)


def _best(
    reference: Reference, nodes: np.ndarray, refined: Problem, run: Solution
) -> tuple[Dense, np.ndarray]:
    """Polynomials of the best order, and the error of each piece.

    Where derivatives amplify rounding, as in stiff problems, fewer of them are better.

    Returns:
        The polynomials without bounds, and for each piece its largest error, as a multiple of
        what is allowed.
    """
    # The last number before a jump is a node as well, with the derivatives before the jump.
    before = np.setdiff1d(np.nextafter(refined.jump_times, -np.inf), nodes)
    times = np.union1d(nodes, before)
    states = run.states[np.searchsorted(refined.ts, times)]
    derivatives = time_derivatives(refined, times, states, _MOST_DERIVATIVES)
    piece = np.clip(np.searchsorted(nodes, refined.ts), 1, len(nodes) - 1) - 1
    best = None
    for count in range(1, 1 + _finite_derivatives(refined, times, derivatives)):
        dense = Dense(times, derivatives[:, : 1 + count], {})
        excess = np.zeros(len(nodes) - 1)
        np.maximum.at(excess, piece, _excess(reference, refined, dense.at(refined.ts), run.states))
        rank = (np.sum(excess > 1.0), np.max(excess))
        if best is None or rank < best[0]:
            best = rank, dense, excess
    assert best is not None
    return best[1:]


def _finite_derivatives(problem: Problem, times: np.ndarray, derivatives: np.ndarray) -> int:
    """How many derivatives are finite at all nodes: no splitting helps where one is not.

    Raises:
        ReferenceRefused: not even the first.
    """
    finite: Any = np.isfinite(derivatives.reshape(*derivatives.shape[:2], -1)).all(axis=2)
    count = int(np.argmin(np.append(finite.all(axis=0), False))) - 1
    if count < 1:
        at = times[np.argmin(finite[:, 1])]
        raise ReferenceRefused(
            f"no dense output for {problem.name!r}: the right-hand side is not finite at t = "
            f"{at:g}. Let the problem start after it, or end before it."
        )
    return count


def _excess(
    reference: Reference, refined: Problem, values: np.ndarray, states: np.ndarray
) -> np.ndarray:
    """How far values are from states, as a multiple of what is allowed, ``(times,)``."""
    worst = np.zeros(len(values))
    for quantity, norm in largest_norms(refined).items():
        size = np.max(np.abs(refined.quantity(quantity, states)), axis=(1, 2))
        rounding = ROUNDING_UNITS * np.finfo(np.float64).eps * np.maximum.accumulate(size)
        allowed = np.maximum(_SHARE * _certified(reference, quantity, refined.ts), rounding)
        errors = distance(refined, norm, values, states)
        worst = np.maximum(
            worst, np.divide(errors, allowed, where=errors > 0, out=np.zeros_like(errors))
        )
    return np.where(np.isnan(worst), np.inf, worst)


def _certified(reference: Reference, quantity: str, times: np.ndarray) -> np.ndarray:
    """The certificate's bound at the next sample, for each time."""
    return reference.certificate.bounds[quantity][np.searchsorted(reference.times, times)]


def _split(nodes: np.ndarray, parts: np.ndarray) -> np.ndarray:
    """Each piece in equal parts, as far as there are floating-point numbers between."""
    pieces = zip(nodes[:-1], nodes[1:], parts, strict=True)
    inner = [np.linspace(start, end, many, endpoint=False) for start, end, many in pieces]
    return np.unique(np.concatenate([*inner, nodes[-1:]]))


def _tested_times(nodes: np.ndarray) -> np.ndarray:
    """The nodes and times between them, in a number that many problems share."""
    lengths = np.diff(nodes)
    times = np.unique(
        [nodes, *[np.append(nodes[:-1] + f * lengths, nodes[-1]) for f in _FRACTIONS]]
    )
    missing = max(_FEWEST_TIMES, 2 ** math.ceil(math.log2(len(times)))) - len(times)
    gaps = np.linspace(0, len(times) - 2, missing).astype(int)
    return _split(times, 1 + np.bincount(gaps, minlength=len(times) - 1))


def _float64_runs(
    reference: Reference, time_limit: float, progress: Progress
) -> tuple[Primary, Witnesses]:
    """The runs of a reference of level `consensus`."""
    method, rtol = method_of(reference), reference.certificate.rtol
    budget = budget_of(reference, time_limit, progress)
    roles = set(get_args(Role)) - {"looser"}

    def primary(problem: Problem) -> Solution:
        return solve_primary(problem, method, rtol, budget)

    def witnesses(problem: Problem, run: Solution) -> Iterator[tuple[Role, Solution]]:
        return witness_runs(reference, budget, problem=problem, primary=run, roles=roles)

    return primary, witnesses


def _extended_runs(
    reference: Reference, time_limit: float, progress: Progress
) -> tuple[Primary, Witnesses]:
    """The runs of a reference of level `extended`, in the same precisions."""
    # Not above: heyoka is an extra.
    from ropeode.references.extended.taylor import solve

    def rounded(problem: Problem, tolerance: float) -> Solution:
        # A run's tolerance is one unit of rounding.
        precision = 1 - round(math.log2(tolerance))
        run = solve(
            problem,
            precision=precision,
            time_limit=time_limit,
            stops=reference.times,
            progress=progress,
        )
        return run.in_float64

    def witnesses(problem: Problem, run: Solution) -> Iterator[tuple[Role, Solution]]:
        del run
        coarse = next(w for w in reference.certificate.witnesses if w.role == "fewer digits")
        yield "fewer digits", rounded(problem, coarse.tolerance)

    return lambda problem: rounded(problem, reference.certificate.rtol), witnesses
