"""Which equation a stepper solves, where it is not the one that it was given."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np

from ropeode.analysis.errors import RESOLUTION_FACTOR
from ropeode.analysis.order import ObservedOrder, observed_order
from ropeode.checking.diagnosis.fit import Fit, Observed
from ropeode.checking.diagnosis.fitted_numbers import (
    Number,
    numbers_of,
    rounded,
    simple,
    with_found,
)
from ropeode.errors import ReferenceRefused
from ropeode.norms import NORMS, distance, motion
from ropeode.problems.problem import Problem
from ropeode.references.reference import Reference

Runs = Sequence[tuple[float, np.ndarray]]


# Of their spread: what numbers may change by that are not simple.
_PART = 0.1


@dataclasses.dataclass(frozen=True)
class Equation:
    """A rope that a stepper solves, beside the one that it was given.

    Arguments:
        numbers: that differ.
        problem: with those.
        orders: of each quantity, observed against the certified reference of that problem.
        tends_with: the order with which each quantity tends to its own limit.
        bound: estimated, of that reference, in the first quantity.
        misfit: the largest difference of the reference to the stepper's limit, in units of
            the limit's uncertainty.
    """

    numbers: tuple[Number, ...]
    problem: Problem
    orders: dict[str, ObservedOrder]
    tends_with: dict[str, int | None]
    bound: float
    misfit: float


def equation(
    seen: Observed, found: Fit, runs: Runs, certified: Callable[[Problem], Reference]
) -> Equation | None:
    """The rope of a fit, if its certified reference confirms that the runs converge to it.

    Arguments:
        seen: what the runs tend to.
        found: the fit.
        runs: step size and states of each.
        certified: makes references.

    Returns:
        None where the reference is not what the runs tend to, or cannot be had.
    """
    fitted = numbers_of(seen.problem, found)
    # Simple numbers that are each within their spread may together be off by more.
    for numbers in (
        tuple(simple(seen.problem, number) for number in fitted),
        tuple(rounded(number, _PART) for number in fitted),
        fitted,
    ):
        problem = with_found(seen.problem, numbers)
        try:
            reference = certified(problem)
        except ReferenceRefused:
            return None
        misfit = misfit_of(seen, reference)
        if misfit <= 1.0:
            break
    else:
        return None
    orders = {
        name: _order(reference, runs, name, float(np.max(problem.quantity(name, seen.uncertainty))))
        for name in seen.orders
    }
    if any(order.verdict == "does not converge" for order in orders.values()):
        return None
    bound = float(reference.bound(NORMS["position-max"])[-1])
    return Equation(numbers, problem, orders, seen.orders, bound, misfit)


def misfit_of(seen: Observed, reference: Reference, spread: float = 0.0) -> float:
    """The largest difference of a reference to a limit, in units of what both are known to.

    Arguments:
        seen: the limit.
        reference: of a problem with the same sample times, and maybe more.
        spread: uncertainty of the reference's own numbers, of the motion.
    """
    worst, samples = 0.0, len(seen.states)
    if reference.trusted < samples:
        return np.inf
    for name, size in seen.motion.items():
        half = seen.problem.quantities.index(name)
        inside = slice(1, samples)
        apart = np.abs(reference.states[inside, half] - seen.states[inside, half])
        bound = float(reference.bound(NORMS[f"{name}-max"])[-1])
        allowed = seen.uncertainty[inside, half] + bound + spread * size
        worst = max(worst, float(np.max(apart / allowed)))
    return worst


def _order(reference: Reference, runs: Runs, name: str, uncertainty: float) -> ObservedOrder:
    """Against a reference whose own numbers are known to the uncertainty of a limit."""
    problem, norm = reference.problem, NORMS[f"{name}-max"]
    errors = [
        float(np.max(distance(problem, norm, states, reference.states)[1:]))
        if np.all(np.isfinite(problem.quantity(name, states)))
        else None
        for _, states in runs
    ]
    return observed_order(
        [dt for dt, _ in runs],
        errors,
        resolution=RESOLUTION_FACTOR * (float(reference.bound(norm)[-1]) + uncertainty),
        motion=float(motion(problem, reference.states, norm)[-1]),
    )
