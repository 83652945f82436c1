"""Runs that blow up: what they show before that, and from which step size on they would not."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ropeode.analysis import ObservedOrder, distances, moved, observed_order, resolution
from ropeode.checking.report import Claims
from ropeode.checking.trajectories.layout import states_of
from ropeode.checking.trajectories.likely_methods import FIRST
from ropeode.checking.trajectories.run_files import Run
from ropeode.errors import InputError
from ropeode.norms import NORMS, Norm
from ropeode.problems import Problem
from ropeode.references import Reference
from ropeode.simulation import step_size
from ropeode.steppers import as_stepper
from ropeode.study import problem_class
from ropeode.theory import stability_limit
from ropeode.validation import listed

# So many further runs, each with twice the steps of the one before.
_RUNS = 3
# Over a few frames coarse runs are hardly asymptotic; a wider interval says nothing of an order.
_WIDEST = 1.0


def before_blow_up(
    reference: Reference, runs: Sequence[Run]
) -> dict[str, tuple[int, ObservedOrder]]:
    """For each quantity the most frames over which runs converge, and the order there.

    At its beginning an unstable run has errors like any other: what grows in it starts from
    rounding or from the error of the first steps.

    Arguments:
        reference: of the problem.
        runs: of which some blow up later.

    Returns:
        By quantity; without those that show no order over any beginning.
    """
    problem, found = reference.problem, {}
    for quantity in runs[0].quantities:
        norm = NORMS[f"{quantity}-max"]
        errors = [_largest(run.states, reference, norm) for run in runs]
        roundings = [
            _largest(states_of(problem, run.values + run.rounding), reference, norm, run.states)
            for run in runs
        ]
        finest = resolution(reference, norm)
        for frames in range(reference.trusted - 1, 0, -1):
            order = observed_order(
                [run.dt for run in runs],
                [each[frames] for each in errors],
                resolution=finest[frames],
                rounding=[each[frames] for each in roundings],
                motion=moved(reference, norm, frames),
            )
            if order.verdict == "converges" and _is_narrow(order):
                found[quantity] = frames, order
                break
    return found


def _is_narrow(order: ObservedOrder) -> bool:
    return order.ci95 is not None and order.ci95[1] - order.ci95[0] <= _WIDEST


def _largest(
    states: np.ndarray, reference: Reference, norm: Norm, others: np.ndarray | None = None
) -> np.ndarray:
    """The largest distance up to each sample; infinite from where it is not finite."""
    far = distances(states, reference, norm)
    if others is not None:
        far = np.abs(far - distances(others, reference, norm))
    return np.maximum.accumulate(np.where(np.isfinite(far), far, np.inf))


def advice(problem: Problem, claims: Claims, finest: float) -> str:
    """From how many steps per frame on the method is stable, and the runs to add.

    Arguments:
        problem: that the runs should solve.
        claims: the method or the order that they are claimed to have.
        finest: the smallest step size of the runs.
    """
    limits = _limits(problem, claims)
    words = "; ".join(
        f"{name} is stable here from {limit} steps per frame on"
        if limit is not None
        else f"{name} is stable here at no number of steps per frame that was tried"
        for name, limit in limits.items()
    )
    known = [limit for limit in limits.values() if limit is not None]
    one = step_size(problem, 1)
    first = max(min(known, default=1), round(2 * one / finest))
    counts = [first * 2**k for k in range(_RUNS)]
    add = f"add runs with {listed(counts)} steps per frame (dt <= {one / first:.3g}) to begin with"
    return f"{words}; {add}" if words else add


def _limits(problem: Problem, claims: Claims) -> dict[str, int | None]:
    """The fewest stable steps per frame of the methods that it may be; empty if unknown."""
    if problem.mechanics is None:
        return {}
    if claims.method is not None:
        names = [claims.method]
    else:
        own = problem_class(problem)
        names = [
            name
            for name in FIRST
            if claims.order is not None
            and (stepper := as_stepper(name)).order(own) == claims.order
            and stepper.solves(own)
            and stepper.refusal(problem) is None
        ]
    limits: dict[str, int | None] = {}
    for name in names:
        try:
            limits[name] = stability_limit(problem, name)
        except InputError:
            # There is no equilibrium about which a small motion could grow.
            continue
    return limits
