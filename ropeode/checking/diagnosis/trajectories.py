"""What trajectories from any program tend to, where it is not the solution of their problem."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from ropeode.checking.diagnosis.effective_problem import (
    EffectiveProblem,
    confirmed_problem,
    parameters_diagnosis,
)
from ropeode.checking.diagnosis.fitted_numbers import NamedMistake, named_mistakes
from ropeode.checking.diagnosis.limits import ObservedLimit, Runs, observe_limit
from ropeode.checking.diagnosis.parameter_fit import Fit, fit_parameters, smallest_fits
from ropeode.checking.report import Diagnosis
from ropeode.checking.written_precision import rounding_of
from ropeode.precision import in_float64
from ropeode.problems import Problem
from ropeode.references import Reference
from ropeode.theory import is_rope

# At first a motion depends on the parameters most simply, and later frames add little. With
# fewer than three frames none could be kept back to confirm what the others say.
_MOST_FRAMES, _FEWEST_FRAMES = 6, 3


@in_float64
def diagnose_trajectories(
    problem: Problem,
    reference: Reference,
    runs: Runs,
    quantities: Sequence[str],
) -> tuple[Diagnosis, ...]:
    """Find what runs of a problem solve instead of it.

    The program cannot be run again. So parameters are fitted to the first two thirds of what
    the runs tend to, and the rest must confirm them.

    Arguments:
        problem: the problem that the program should solve.
        reference: of the problem.
        runs: step size and states ``(times, *state)`` of each; not-a-number from where it
            diverged, and for quantities that the files lack.
        quantities: of the problem, that the runs have.

    Returns:
        One diagnosis; `unknown` if no change of parameters explains the runs.
    """
    if not is_rope(problem):
        return (_unknown("the problem has no parameters that could be fitted"),)
    beginnings = [
        (frames, *_beginning(problem, runs, frames))
        for frames in range(min(problem.frames, _MOST_FRAMES, reference.trusted - 1), 0, -1)
    ]
    for frames, part, part_runs in beginnings:
        rounding = {name: _rounding(part_runs, name, part) for name in quantities}
        limit = observe_limit(part, part_runs, quantities, rounding)
        if limit is not None:
            return (_diagnose_limit(limit, frames, part_runs, reference),)
    return (
        _unknown(
            "the runs do not tend to any limit with an integer order as dt goes to 0 (at least "
            "three step sizes are needed)"
        ),
    )


def _beginning(problem: Problem, runs: Runs, frames: int) -> tuple[Problem, Runs]:
    """The first frames of a problem and of its runs."""
    return (
        problem.changed(ts=problem.ts[: frames + 1], exact=None),
        [(dt, states[: frames + 1]) for dt, states in runs],
    )


def _rounding(runs: Runs, quantity: str, problem: Problem) -> float:
    half = problem.quantities.index(quantity)
    values = np.concatenate([states[1:, half].ravel() for _, states in runs])
    return rounding_of(values[np.isfinite(values)])


def _diagnose_limit(
    limit: ObservedLimit, frames: int, runs: Runs, reference: Reference
) -> Diagnosis:
    beginning = dataclasses.replace(reference, states=reference.states[: frames + 1])
    orders = " and ".join(f"{order} in {name}" for name, order in limit.orders.items() if order)
    if limit.misfit(beginning) <= 1.0:
        return _unknown(
            f"the runs tend to the right solution over the first {frames} frames, with order "
            f"{orders or 'none'}; runs of a single problem cannot show why the order is too low"
        )
    if limit.stands_still(beginning):
        return _unknown("the rope stops moving as dt goes to 0")
    if frames < _FEWEST_FRAMES:
        return _unknown(
            f"the runs tend to a wrong solution, but their limit is certain enough for a fit only "
            f"over the first {frames} frames, too few to keep some back to confirm it; use "
            "smaller steps, or samples at shorter intervals"
        )
    confirmed = _confirmed(limit, frames, runs)
    if not confirmed:
        return _unknown(
            "the runs tend to a wrong solution; no change of gravity, damping, stiffness, mass, "
            "rest length or initial velocity explains it"
        )
    return parameters_diagnosis(confirmed, [_mistakes(limit.problem, each) for each in confirmed])


def _confirmed(limit: ObservedLimit, frames: int, runs: Runs) -> list[EffectiveProblem]:
    """Ropes fitted to the beginning that also predict the rest."""
    uncertainty = limit.uncertainty.copy()
    uncertainty[-(frames // 3) :] = np.inf
    beginning = dataclasses.replace(limit, uncertainty=uncertainty)
    confirmed = []
    for fit in smallest_fits(beginning):
        whole = fit_parameters(limit, fit.names, fit.changes, near=True)
        if fit.names and whole.explains and _agree(fit, whole):
            solved = confirmed_problem(limit, whole, runs)
            if solved is not None:
                confirmed.append(solved)
    return confirmed


def _agree(first: Fit, second: Fit) -> bool:
    """Whether two fits of the same parameters agree within their spreads."""
    return bool(np.all(np.abs(first.changes - second.changes) <= first.spread + second.spread))


def _mistakes(problem: Problem, solved: EffectiveProblem) -> tuple[NamedMistake, ...]:
    """The mistake that would explain each number, where there is exactly one."""
    each = (named_mistakes(problem, number) for number in solved.numbers)
    return tuple(mistakes[0] for mistakes in each if len(mistakes) == 1)


def _unknown(line: str) -> Diagnosis:
    return Diagnosis("unknown", line)
