"""Steppers that solve the right equations, but faster or slower."""

from __future__ import annotations

import numpy as np

from ropeode.checking.candidate import Candidate
from ropeode.checking.check_context import reference_of
from ropeode.checking.diagnosis.diagnostic_ropes import alike, alike_again
from ropeode.checking.diagnosis.equation import misfit_of
from ropeode.checking.diagnosis.fit import Observed, observed
from ropeode.checking.diagnosis.fitted_numbers import shortest
from ropeode.checking.diagnosis.runs import runs_of
from ropeode.checking.report import Diagnosis
from ropeode.errors import ReferenceRefused
from ropeode.problems.problem import Problem
from ropeode.references.reference import Reference
from ropeode.simulation.system import system

# Gauss-Newton: iterations, and the paces that are looked at.
_MOST_ITERATIONS = 8
_SLOWEST, _FASTEST = 0.2, 5.0
# In units of the pace's spread: closer than that it changes no more.
_STILL = 1e-2


def another_pace(candidate: Candidate) -> Diagnosis | None:
    """Say so if a stepper is where the solution will be later, or was earlier.

    Without a force that depends on time, ``y' = s f(y)`` has the solution ``y(s t)``: that is
    what is solved where positions and velocities both change by s times as much as they should
    in each step.

    Arguments:
        candidate: the stepper.

    Returns:
        None where no pace explains what its runs tend to, on two ropes.
    """
    first, second = (
        observed(problem, runs_of(candidate, problem), problem.quantities)
        for problem in (alike(), alike_again())
    )
    if first is None or second is None or first.stands_still(reference_of(alike()).states):
        return None
    try:
        pace, spread = _fitted(first)
        pace = shortest(pace, spread)
        misfits = [misfit_of(seen, _paced(seen.problem, pace)) for seen in (first, second)]
    except ReferenceRefused:
        return None
    if abs(pace - 1.0) <= spread or max(misfits) > 1.0:
        return None
    return Diagnosis(
        "pace",
        f"your stepper solves the right equations at {pace:.4g} times the pace: in each step "
        f"positions and velocities both change {pace:.4g} times as much as they should, as with "
        "weights that add up to that, or with another dt than the one given",
        {"pace": pace, "spread": spread, "misfits": misfits},
    )


def _paced(problem: Problem, pace: float) -> Reference:
    """The certified solution at times that pass faster."""
    start = problem.ts[0]
    return reference_of(problem.changed(ts=start + pace * (problem.ts - start)))


def _fitted(seen: Observed) -> tuple[float, float]:
    """The pace that comes closest to a limit, and how far it may be off."""
    problem, pace, spread = seen.problem, 1.0, np.inf
    own = system(problem.rhs, problem.mechanics, problem.args, in_numpy=True)
    rhs = own.equations.rhs
    passed = problem.ts - problem.ts[0]
    for _ in range(_MOST_ITERATIONS):
        states = _paced(problem, pace).states
        if len(states) < len(seen.states):
            break
        slopes = np.stack(
            [
                time * rhs(problem.ts[0], y, problem.args)
                for time, y in zip(passed, states, strict=True)
            ]
        )
        steep = (slopes / seen.uncertainty)[1:].ravel()
        apart = ((seen.states - states) / seen.uncertainty)[1:].ravel()
        spread = float(np.sum(np.abs(steep)) / (steep @ steep))
        change = float(steep @ apart / (steep @ steep))
        pace = float(np.clip(pace + change, _SLOWEST, _FASTEST))
        if abs(change) <= _STILL * spread:
            break
    return pace, spread
