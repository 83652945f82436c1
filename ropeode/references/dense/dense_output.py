"""Where the nodes of a dense output go, and how good it is: both are measured.

The solver of the reference is run with its steps ending on the nodes and on points between them.
A piece is split until its polynomial meets those points as closely as is asked. Then the other
runs of the certificate are made once more with steps ending there, and held against the polynomials
as they are against the samples. So the bound between the samples has the meaning of the
certificate's; it includes what an orbit's error grows by on the way through its pericentre.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator
from typing import get_args

import numpy as np

from ropeode.errors import ReferenceRefused
from ropeode.norms import distance
from ropeode.problems.problem import Problem
from ropeode.references.certificate import (
    ROUNDING_UNITS,
    Level,
    Role,
    bounds,
    largest_norms,
    witness,
)
from ropeode.references.dense.polynomials import Dense, time_derivatives
from ropeode.references.ladder import Progress, solve_primary
from ropeode.references.reference import TIME_LIMIT, Reference
from ropeode.references.solvers.solution import Solution
from ropeode.references.witnesses import method_of, witness_runs

# Order 10. More cost more to compile than they save.
_MOST_DERIVATIVES = 4
# The polynomials may add so much of the bound, so that it need not grow by much.
_SHARE = 0.1
# Where a piece is looked at: the leading term of its error is largest in the middle.
_FRACTIONS = (0.22, 0.5, 0.71)
# Where a pass makes the largest error less than so many times smaller, it may be rounding if it
# is no more than so many times what is allowed: the bound, or what rounds a bound of half a unit.
_LEAST_GAIN = 8.0
_ROUNDING: dict[Level, float] = {"consensus": 10.0, "extended": 1000.0}
# Steps of an order-8 method that one piece replaces, to begin with.
_STEPS_PER_PIECE = 4
_MOST_PARTS = 8
_MOST_PASSES = 16
_MOST_NODES = 8192
_MOST_NODES_PER_FRAME = 16
_MOST_BYTES = 2**28

# One more run of the reference's own solver, and those that it is held against.
Primary = Callable[[Problem], Solution]
Witnesses = Callable[[Problem, Solution], Iterator[tuple[Role, Solution]]]


def with_dense_output(
    known: Reference,
    *,
    time_limit: float = TIME_LIMIT,
    progress: Progress = lambda text: None,
) -> Reference:
    """The same reference, with states at all times that are trusted.

    Arguments:
        known: a reference; it may come from a file.
        time_limit: in seconds, for each run in extended precision.
        progress: called with a few words before each run.

    Raises:
        InputError: the reference is of level `extended`, and heyoka is missing.
        ReferenceRefused: the bound between the first samples exceeds the accuracy, or the
            solver does not arrive when its steps end on the nodes.
    """
    if known.certificate.level == "extended":
        primary, witnesses = _extended_runs(known, time_limit, progress)
    else:
        primary, witnesses = _float64_runs(known, progress)
    dense, refined, run = _fine_enough(known, primary)
    dense = _through_the_samples(known, dense)
    judged = dataclasses.replace(run, states=dense.at(refined.ts))
    held = [witness(refined, judged, other, role) for role, other in witnesses(refined, run)]
    estimated = bounds(refined, judged, held, refined.drift(judged.states))
    at = np.searchsorted(refined.ts, dense.times)
    measured = {
        quantity: np.maximum(series[at], _certified(known, quantity, dense.times))
        for quantity, series in estimated.items()
    }
    first, accuracy = measured[known.problem.quantities[0]], known.certificate.accuracy
    trusted = int(np.argmin(np.append(first <= accuracy, False)))
    if trusted < 2:
        raise ReferenceRefused(
            f"no dense output for {known.problem.name!r}: before t = {dense.times[1]:g} already "
            f"the bound is {first[1]:.1e}, and the accuracy {accuracy:.1e}. Ask for less accuracy, "
            "or for more samples."
        )
    whole = dataclasses.replace(dense, bounds=measured)
    return dataclasses.replace(known, dense=whole.until(float(dense.times[trusted - 1])))


def _fine_enough(known: Reference, primary: Primary) -> tuple[Dense, Problem, Solution]:
    """Polynomials with nodes so close that they are good enough, if there may be so many.

    Returns:
        The polynomials without bounds, the problem with samples on the nodes and between them,
        and the run that stopped there.
    """
    problem, samples = known.problem, known.times[: known.trusted]
    most = max(_MOST_NODES, _MOST_NODES_PER_FRAME * len(samples))
    most = min(most, _MOST_BYTES // ((1 + _MOST_DERIVATIVES) * problem.y0.nbytes))
    jumps = tuple(jump for jump in problem.jump_times if jump < samples[-1])
    parts = known.certificate.steps // (_STEPS_PER_PIECE * problem.frames)
    # Short steps may be for stability, as in stiff problems, where few pieces may do.
    parts = min(max(1, parts), _MOST_PARTS)
    nodes = np.union1d(_split(samples, np.full(len(samples) - 1, parts)), jumps)
    before = np.inf
    for _ in range(_MOST_PASSES):
        refined = dataclasses.replace(problem, ts=_looked_at(nodes), jump_times=jumps)
        run = primary(refined)
        if len(run.states) < len(refined.ts):
            why = f"{run.solver} {run.failure}"
            raise ReferenceRefused(f"no dense output for {problem.name!r}: {why}.")
        dense, excess = _best(known, nodes, refined, run)
        worst = np.max(excess)
        # What hardly falls any more is rounding, that of the states in the derivatives included.
        if worst <= 1.0 or before / _LEAST_GAIN < worst <= _ROUNDING[known.certificate.level]:
            break
        parts = np.ceil(1.1 * np.minimum(excess, 1e300) ** (1 / dense.order))
        parts = np.where(excess > 1.0, np.clip(parts, 2, _MOST_PARTS), 1)
        finer = _split(nodes, parts.astype(int))
        if len(finer) == len(nodes) or len(finer) > most:
            break
        nodes, before = finer, worst
    return dense, refined, run


def _through_the_samples(known: Reference, dense: Dense) -> Dense:
    """The polynomials with the reference's own states at the samples, and derivatives there."""
    sampled = np.isin(dense.times, known.times)
    times = dense.times[sampled]
    states = known.states[np.searchsorted(known.times, times)]
    derivatives = dense.derivatives.copy()
    count = derivatives.shape[1] - 1
    derivatives[sampled] = time_derivatives(known.problem, times, states, count)
    return dataclasses.replace(dense, derivatives=derivatives)


def _best(
    known: Reference, nodes: np.ndarray, refined: Problem, run: Solution
) -> tuple[Dense, np.ndarray]:
    """Polynomials of the order that serves best, and what is left of each piece's error.

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
    for count in range(1, 1 + _MOST_DERIVATIVES):
        dense = Dense(times, derivatives[:, : 1 + count], {})
        excess = np.zeros(len(nodes) - 1)
        np.maximum.at(excess, piece, _excess(known, refined, dense.at(refined.ts), run.states))
        judgement = (np.sum(excess > 1.0), np.max(excess))
        if best is None or judgement < best[0]:
            best = judgement, dense, excess
    assert best is not None
    return best[1:]


def _excess(
    known: Reference, refined: Problem, values: np.ndarray, states: np.ndarray
) -> np.ndarray:
    """How far values are from states, as a multiple of what is allowed, ``(times,)``."""
    worst = np.zeros(len(values))
    for quantity, norm in largest_norms(refined).items():
        size = np.max(np.abs(refined.quantity(quantity, states)), axis=(1, 2))
        rounding = ROUNDING_UNITS * np.finfo(np.float64).eps * np.maximum.accumulate(size)
        allowed = np.maximum(_SHARE * _certified(known, quantity, refined.ts), rounding)
        apart = distance(refined, norm, values, states)
        worst = np.maximum(
            worst, np.divide(apart, allowed, where=apart > 0, out=np.zeros_like(apart))
        )
    return np.where(np.isnan(worst), np.inf, worst)


def _certified(known: Reference, quantity: str, times: np.ndarray) -> np.ndarray:
    """The certificate's bound at the first sample that is not before each time."""
    return known.certificate.bounds[quantity][np.searchsorted(known.times, times)]


def _split(nodes: np.ndarray, parts: np.ndarray) -> np.ndarray:
    """Each piece in so many equal parts, as far as there are numbers between."""
    pieces = zip(nodes[:-1], nodes[1:], parts, strict=True)
    inner = [np.linspace(start, end, many, endpoint=False) for start, end, many in pieces]
    return np.unique(np.concatenate([*inner, nodes[-1:]]))


def _looked_at(nodes: np.ndarray) -> np.ndarray:
    """The nodes and times between them; a power of two, so that compiled solvers serve again."""
    lengths = np.diff(nodes)
    times = np.unique(
        [nodes, *[np.append(nodes[:-1] + f * lengths, nodes[-1]) for f in _FRACTIONS]]
    )
    missing = 2 ** math.ceil(math.log2(len(times))) - len(times)
    gaps = np.linspace(0, len(times) - 2, missing).astype(int)
    return np.union1d(times, (times[gaps] + times[gaps + 1]) / 2)


def _float64_runs(known: Reference, progress: Progress) -> tuple[Primary, Witnesses]:
    """Those of level `consensus`, in their certificate's words."""
    made, method = known.certificate, method_of(known)
    roles = set(get_args(Role)) - {"looser"}

    def primary(problem: Problem) -> Solution:
        return solve_primary(problem, method, made.rtol, progress)

    def witnesses(problem: Problem, run: Solution) -> Iterator[tuple[Role, Solution]]:
        return witness_runs(known, progress, problem=problem, primary=run, roles=roles)

    return primary, witnesses


def _extended_runs(
    known: Reference, time_limit: float, progress: Progress
) -> tuple[Primary, Witnesses]:
    """Those of level `extended`, of the same precisions."""
    # Not above: heyoka is an extra.
    from ropeode.references.extended.taylor import solve

    def rounded(problem: Problem, tolerance: float) -> Solution:
        # A run's tolerance is one unit of rounding.
        precision = 1 - round(math.log2(tolerance))
        run = solve(
            problem,
            precision=precision,
            time_limit=time_limit,
            stops=known.times,
            progress=progress,
        )
        return Solution(
            solver=known.certificate.solver,
            rtol=tolerance,
            atol=0.0,
            states=run.rounded,
            steps=run.steps,
            seconds=run.seconds,
            compile_seconds=run.compile_seconds,
            failure=run.failure,
        )

    def witnesses(problem: Problem, run: Solution) -> Iterator[tuple[Role, Solution]]:
        del run
        coarse = next(w for w in known.certificate.witnesses if w.role == "fewer digits")
        yield "fewer digits", rounded(problem, coarse.tolerance)

    return lambda problem: rounded(problem, known.certificate.rtol), witnesses
