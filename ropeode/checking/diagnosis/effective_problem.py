"""The rope that a stepper solves instead of the one that it should solve."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from ropeode.analysis import (
    ORDER_TOLERANCE,
    RESOLUTION_FACTOR,
    ObservedOrder,
    distances,
    moved,
    observed_order,
    resolution,
)
from ropeode.checking.diagnosis.fitted_numbers import (
    NamedMistake,
    Number,
    numbers_of,
    rounded,
    simplified,
    with_fitted,
)
from ropeode.checking.diagnosis.limits import ObservedLimit, Runs
from ropeode.checking.diagnosis.parameter_fit import Fit
from ropeode.checking.report import Diagnosis
from ropeode.errors import ReferenceRefused
from ropeode.norms import NORMS
from ropeode.references import Reference, reference_for

# By how much of its spread a number that is not simple may be rounded.
_PART = 0.1


@dataclasses.dataclass(frozen=True)
class EffectiveProblem:
    """A rope that a stepper solves.

    Arguments:
        numbers: the parameters that differ from the claimed ones.
        orders: of each quantity, observed against the certified reference of this rope.
        limit_orders: the order with which each quantity tends to its own limit.
        bound: the estimated bound of that reference, in the first quantity.
        misfit: the largest difference between the reference and the limit of the runs, in units
            of the limit's uncertainty.
    """

    numbers: tuple[Number, ...]
    orders: dict[str, ObservedOrder]
    limit_orders: dict[str, int | None]
    bound: float
    misfit: float


def confirmed_problem(limit: ObservedLimit, fit: Fit, runs: Runs) -> EffectiveProblem | None:
    """The rope of a fit, if its certified reference confirms that the runs converge to it.

    Returns:
        None if the runs do not tend to the reference, or it is refused.
    """
    fitted = numbers_of(limit.problem, fit)
    # Simple numbers that are each within their spread may together be off by more.
    for numbers in (
        tuple(simplified(limit.problem, number) for number in fitted),
        tuple(rounded(number, _PART) for number in fitted),
        fitted,
    ):
        try:
            reference = reference_for(with_fitted(limit.problem, numbers))
        except ReferenceRefused:
            return None
        misfit = limit.misfit(reference)
        if misfit <= 1.0:
            break
    else:
        return None
    orders = {name: _order(reference, runs, name, limit) for name in limit.orders}
    if any(order.verdict == "does not converge" for order in orders.values()):
        return None
    bound = float(reference.bound(NORMS["position-max"])[-1])
    return EffectiveProblem(numbers, orders, limit.orders, bound, misfit)


def _order(reference: Reference, runs: Runs, name: str, limit: ObservedLimit) -> ObservedOrder:
    """Observed against a reference whose parameters are as uncertain as the limit."""
    problem, norm = reference.problem, NORMS[f"{name}-max"]
    uncertainty = float(np.max(problem.quantity(name, limit.uncertainty)))
    errors = [
        float(np.max(distances(states, reference, norm)[1:]))
        if np.all(np.isfinite(problem.quantity(name, states)))
        else None
        for _, states in runs
    ]
    return observed_order(
        [dt for dt, _ in runs],
        errors,
        resolution=float(resolution(reference, norm)[-1]) + RESOLUTION_FACTOR * uncertainty,
        motion=moved(reference, norm),
    )


def parameters_diagnosis(
    solved: Sequence[EffectiveProblem], mistakes: Sequence[tuple[NamedMistake, ...]]
) -> Diagnosis:
    """The diagnosis that a stepper solves a rope with other parameters.

    Arguments:
        solved: ropes between which the runs cannot decide, at least one.
        mistakes: for each rope the mistakes that may explain it.
    """
    first, *others = solved
    words = [" and ".join(number.words for number in each.numbers) for each in solved]
    said = [[f"as if {each.words}" for each in several] for several in mistakes]
    line = f"your stepper solves, to {_orders_in_words(first)}, the rope with "
    if not others:
        line += ": ".join(filter(None, (words[0], "; ".join(said[0]))))
    else:
        line += "; or, which moves exactly the same, with ".join(
            f"{each} ({'; '.join(texts)})" if texts else each
            for each, texts in zip(words, said, strict=True)
        )
    numbers = [{number.name: number.as_json() for number in each.numbers} for each in solved]
    evidence = {
        "parameters": numbers[0],
        "alternatives": numbers[1:],
        "orders": {
            name: {"observed": order.observed, "ci95": order.ci95, "verdict": order.verdict}
            for name, order in first.orders.items()
        },
        "reference_bound": first.bound,
        "misfit": first.misfit,
        "hints": list(dict.fromkeys(text for texts in said for text in texts)),
    }
    # Which of several changes is meant nobody knows.
    remedies = [] if others else [each.remedy for each in mistakes[0]]
    return Diagnosis("parameters", line, evidence, "; ".join(dict.fromkeys(remedies)))


def _orders_in_words(solved: EffectiveProblem) -> str:
    """The orders of all quantities, as integers where they are close to one.

    If too few errors exceed the uncertainty of the numbers, it is the order with which the runs
    tend to their limit.
    """
    texts = {
        name: _order_in_words(order, solved.limit_orders[name])
        for name, order in solved.orders.items()
    }
    if len({*texts.values()}) == 1:
        return next(iter(texts.values()))
    return " and ".join(
        f"{text} ({'positions' if name == 'position' else 'velocities'})"
        for name, text in texts.items()
    )


def _order_in_words(order: ObservedOrder, limit_order: int | None) -> str:
    if order.observed is None:
        return "an unknown order" if limit_order is None else f"order {limit_order}"
    near = round(order.observed)
    whole = abs(order.observed - near) <= ORDER_TOLERANCE
    return f"order {near if whole else f'{order.observed:.2f}'}"
