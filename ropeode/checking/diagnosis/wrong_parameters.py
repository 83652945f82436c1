"""Steppers that solve the rope with other parameters than it has."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ropeode.checking.check_context import Examination, reference_of
from ropeode.checking.diagnosis.diagnostic_ropes import (
    uniform_rope,
    uniform_rope_with_other_parameters,
    uniform_rope_with_other_start,
)
from ropeode.checking.diagnosis.effective_problem import confirmed_problem, parameters_diagnosis
from ropeode.checking.diagnosis.fitted_numbers import (
    Number,
    matching_mistakes,
    numbers_of,
    with_fitted,
)
from ropeode.checking.diagnosis.limits import ObservedLimit, observe_limit, runs_of, stepper_limit
from ropeode.checking.diagnosis.parameter_fit import Fit, fit_parameters, smallest_fits
from ropeode.checking.report import Diagnosis
from ropeode.errors import ReferenceRefused
from ropeode.problems.problem import Problem

# The uncertainty of the first limit grows by this factor on its way to the second rope.
_CARRIED_OVER = 10.0


def diagnose_parameters(examination: Examination) -> Diagnosis | bool:
    """Find which rope a stepper solves, if it is not the one that it should solve.

    Parameters are fitted to the limit of its runs on one rope. They must explain the limit
    within its uncertainty, agree with a certified reference of the rope that they define, and
    predict the limit on a second rope with another initial state.

    Returns:
        True if it solves the right rope, on which all nodes and all springs are the same; False
        if no change of parameters passes all these tests.
    """
    problem = uniform_rope()
    runs = runs_of(examination, problem)
    limit = observe_limit(problem, runs, problem.quantities)
    if limit is None or limit.stands_still(reference_of(problem)):
        return False
    fits = smallest_fits(limit)
    if not fits or not fits[0].names:
        return bool(fits)
    other = uniform_rope_with_other_start()
    second = stepper_limit(examination, other)
    if second is None:
        return False
    confirmed = [
        (fit, solved)
        for fit in fits
        if (solved := confirmed_problem(limit, fit, runs, reference_of)) is not None
        and _predicts(solved.numbers, limit, second)
    ]
    if not confirmed:
        return False
    mistakes = _mistakes(examination, [(fit, solved.numbers) for fit, solved in confirmed])
    return parameters_diagnosis([solved for _, solved in confirmed], mistakes)


def _predicts(numbers: Sequence[Number], limit: ObservedLimit, second: ObservedLimit) -> bool:
    """Whether numbers that were fitted to one limit predict a second one."""
    try:
        reference = reference_of(with_fitted(second.problem, numbers))
    except ReferenceRefused:
        return False
    uncertainty = max(
        float(np.max(limit.problem.quantity(name, limit.uncertainty))) / size
        for name, size in limit.motion.items()
    )
    return second.misfit(reference, _CARRIED_OVER * uncertainty) <= 1.0


def _mistakes(
    examination: Examination, fits: Sequence[tuple[Fit, Sequence[Number]]]
) -> list[tuple[str, ...]]:
    """For each fit the mistakes that explain it on a rope with other parameters too."""
    problem, other = uniform_rope(), uniform_rope_with_other_parameters()
    limit = stepper_limit(examination, other)
    if limit is None:
        return [() for _ in fits]
    mistakes = []
    for fit, numbers in fits:
        second = fit_parameters(limit, fit.names)
        if not second.explains:
            mistakes.append(())
            continue
        pairs = zip(numbers, numbers_of(other, second), strict=True)
        texts = (_mistake(problem, other, one, another) for one, another in pairs)
        mistakes.append(tuple(text for text in texts if text))
    return mistakes


def _mistake(problem: Problem, other: Problem, one: Number, another: Number) -> str | None:
    """The one mistake that explains a number on both ropes; None if there is none, or several."""
    on_other = {mistake.words for mistake in matching_mistakes(other, another)}
    on_both = [
        mistake.words for mistake in matching_mistakes(problem, one) if mistake.words in on_other
    ]
    if on_both:
        return on_both[0] if len(on_both) == 1 else None
    spread = one.spread + another.spread
    if np.all(np.abs(one.fitted - another.fitted) <= spread) and not one.factor:
        return f"{one.what} is the same on every rope, whatever the problem says"
    return None
