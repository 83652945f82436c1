"""What trajectories of any program tend to, where it is not the solution that was asked for."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from ropeode.checking.diagnosis.damping_per_step import damping_rate_diagnosis
from ropeode.checking.diagnosis.equation import Equation, Runs, equation, misfit_of
from ropeode.checking.diagnosis.fit import Fit, Observed, explanations, fit, observed
from ropeode.checking.diagnosis.fitted_numbers import laws_that_hold
from ropeode.checking.diagnosis.parameters import explicable
from ropeode.checking.diagnosis.wording import told
from ropeode.checking.diagnosis.written_rounding import rounding_of
from ropeode.checking.report import Diagnosis
from ropeode.precision import in_float64
from ropeode.problems.problem import Problem
from ropeode.references.compute import reference
from ropeode.references.reference import Reference

# Frames that are looked at: at first motions depend on numbers most simply, and what happens
# later adds little. Of fewer none could be kept back to confirm what the others say.
_MOST_FRAMES, _FEWEST_FRAMES = 6, 3


@in_float64
def diagnose_trajectories(
    problem: Problem,
    known: Reference,
    runs: Sequence[tuple[float, np.ndarray]],
    quantities: Sequence[str],
) -> tuple[Diagnosis, ...]:
    """Find out what given runs of a problem solve instead of it.

    No further runs can be made. So numbers are fitted to the first two thirds of what the runs
    tend to, and have to stand up to the rest.

    Arguments:
        problem: that was to be solved.
        known: its reference.
        runs: step size and states ``(times, *state)`` of each; not-a-number from where it
            diverged, and for quantities that are not known.
        quantities: of the problem, that the runs have.

    Returns:
        One diagnosis; `unknown` where no change of numbers explains the runs.
    """
    if not explicable(problem):
        return (_unknown("of its numbers none are known that could be fitted"),)
    short = [
        (frames, *_cut(problem, runs, frames))
        for frames in range(min(problem.frames, _MOST_FRAMES, known.trusted - 1), 0, -1)
    ]
    for _, part, cut in short[:1]:
        if (per_step := damping_rate_diagnosis(part, cut, quantities)) is not None:
            return (per_step,)
    for frames, part, cut in short:
        rounding = {name: rounding_of(cut, name, part) for name in quantities}
        seen = observed(part, cut, quantities, rounding)
        if seen is not None:
            return (_of_limit(seen, frames, cut, known),)
    return (
        _unknown(
            "the runs do not tend to anything with a whole order as dt goes to 0 (at least three "
            "step sizes are needed)"
        ),
    )


def _cut(problem: Problem, runs: Runs, frames: int) -> tuple[Problem, Runs]:
    """The beginning of a problem and of its runs."""
    return (
        problem.changed(ts=problem.ts[: frames + 1], exact=None),
        [(dt, states[: frames + 1]) for dt, states in runs],
    )


def _of_limit(seen: Observed, frames: int, runs: Runs, known: Reference) -> Diagnosis:
    beginning = dataclasses.replace(known, states=known.states[: frames + 1])
    orders = " and ".join(f"{order} in {name}" for name, order in seen.orders.items() if order)
    if misfit_of(seen, beginning) <= 1.0:
        return _unknown(
            f"the runs tend to the right solution over the first {frames} frames, with order "
            f"{orders or 'none'}; what costs them an order cannot be told from runs of one problem"
        )
    if seen.stands_still(beginning.states):
        return _unknown("the rope comes to a standstill as dt goes to 0")
    if frames < _FEWEST_FRAMES:
        return _unknown(
            f"the runs tend to something else than the solution, and only their first {frames} "
            f"frames are known well enough, of which none can be kept back to confirm a fit; give "
            "runs with smaller steps, or samples at shorter times"
        )
    found = _confirmed(seen, frames, runs)
    if not found:
        return _unknown(
            "the runs tend to something else than the solution, and no change of gravity, "
            "damping, stiffness, mass, rest length or initial velocity was found that explains it"
        )
    return told(found, [_reasons(seen.problem, each) for each in found])


def _confirmed(seen: Observed, frames: int, runs: Runs) -> list[Equation]:
    """Ropes fitted to the beginning that also give the rest."""
    uncertainty = seen.uncertainty.copy()
    uncertainty[-(frames // 3) :] = np.inf
    beginning = dataclasses.replace(seen, uncertainty=uncertainty)
    found = []
    for first in explanations(beginning):
        whole = fit(seen, first.names, first.changes, near=True)
        if first.names and whole.explains and _agree(first, whole):
            solved = equation(seen, whole, runs, reference)
            if solved is not None:
                found.append(solved)
    return found


def _agree(first: Fit, second: Fit) -> bool:
    """Whether two fits of the same numbers differ by no more than they may be off."""
    return bool(np.all(np.abs(first.changes - second.changes) <= first.spread + second.spread))


def _reasons(problem: Problem, found: Equation) -> tuple[str, ...]:
    """Mistakes that would give the numbers, where there is just one for a number."""
    each = (laws_that_hold(problem, number) for number in found.numbers)
    return tuple(f"as if {laws[0].words}" for laws in each if len(laws) == 1)


def _unknown(line: str) -> Diagnosis:
    return Diagnosis("unknown", line)
