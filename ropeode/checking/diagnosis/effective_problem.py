"""The rope that a stepper solves in place of the one that it was given."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ropeode.checking.candidate import Candidate
from ropeode.checking.check_context import reference_of
from ropeode.checking.diagnosis.diagnostic_ropes import alike, alike_again, alike_otherwise
from ropeode.checking.diagnosis.equation import equation, misfit_of
from ropeode.checking.diagnosis.fit import Fit, Observed, explanations, fit, observed
from ropeode.checking.diagnosis.fitted_numbers import Number, laws_that_hold, numbers_of, with_found
from ropeode.checking.diagnosis.runs import runs_of
from ropeode.checking.diagnosis.wording import told
from ropeode.checking.report import Diagnosis
from ropeode.errors import ReferenceRefused
from ropeode.problems.problem import Problem
from ropeode.references.reference import Reference

# Of the uncertainty of the first limit, as it reaches the prediction of a second one.
_CARRIED_OVER = 10.0


def solved_instead(candidate: Candidate) -> Diagnosis | bool:
    """Say which rope a stepper solves, if it is another one than it was given.

    Numbers are fitted to what its runs tend to on one rope. They have to explain that to its
    uncertainty, a certified reference of the rope that they make has to agree, and they have
    to predict the limit on a second rope from another initial state.

    Arguments:
        candidate: the stepper.

    Returns:
        True where it solves the one that it was given, whose nodes and springs are alike; False
        where no change of numbers stands up to all that.
    """
    problem = alike()
    runs = runs_of(candidate, problem)
    seen = observed(problem, runs, problem.quantities)
    if seen is None or seen.stands_still(reference_of(problem).states):
        return False
    fits = explanations(seen)
    if not fits or not fits[0].names:
        return bool(fits)
    again = observed(alike_again(), runs_of(candidate, alike_again()), problem.quantities)
    if again is None:
        return False
    found = [
        (each, solved)
        for each in fits
        if (solved := equation(seen, each, runs, reference_of)) is not None
        and _predicts(solved.numbers, seen, again)
    ]
    if not found:
        return False
    reasons = _reasons(candidate, [(each, solved.numbers) for each, solved in found])
    return told([solved for _, solved in found], reasons)


def _predicts(numbers: Sequence[Number], seen: Observed, again: Observed) -> bool:
    """Whether numbers that were fitted to one limit give another."""
    try:
        reference: Reference = reference_of(with_found(again.problem, numbers))
    except ReferenceRefused:
        return False
    known_to = max(
        float(np.max(seen.problem.quantity(name, seen.uncertainty))) / size
        for name, size in seen.motion.items()
    )
    return misfit_of(again, reference, _CARRIED_OVER * known_to) <= 1.0


def _reasons(
    candidate: Candidate, found: Sequence[tuple[Fit, Sequence[Number]]]
) -> list[tuple[str, ...]]:
    """For each set of numbers the mistakes that give them on a rope with other numbers too."""
    given, other = alike(), alike_otherwise()
    seen = observed(other, runs_of(candidate, other), other.quantities)
    if seen is None:
        return [() for _ in found]
    reasons = []
    for each, numbers in found:
        there = fit(seen, each.names)
        if not there.explains:
            reasons.append(())
            continue
        pairs = zip(numbers, numbers_of(other, there), strict=True)
        texts = (_reason(given, other, here, again) for here, again in pairs)
        reasons.append(tuple(text for text in texts if text))
    return reasons


def _reason(given: Problem, other: Problem, here: Number, there: Number) -> str | None:
    """The one mistake that gives both numbers; None where there is none, or more."""
    both = [
        law.words
        for law in laws_that_hold(given, here)
        if law.words in {each.words for each in laws_that_hold(other, there)}
    ]
    if both:
        return both[0] if len(both) == 1 else None
    spread = here.spread + there.spread
    if np.all(np.abs(here.found - there.found) <= spread) and not here.factor:
        return f"{here.what} is the same whatever it should be"
    return None
