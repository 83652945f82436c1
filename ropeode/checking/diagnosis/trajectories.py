"""What trajectories from any program tend to, where it is not the solution of their problem."""

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
)
from ropeode.checking.diagnosis.fitted_numbers import (
    NamedMistake,
    Number,
    named_mistakes,
    numbers_of,
    rounded,
    simplified,
)
from ropeode.checking.diagnosis.fitted_terms import (
    FINEST,
    Fit,
    Fitting,
    groups_of,
    motion_to,
    terms_with,
)
from ropeode.checking.diagnosis.limits import ObservedLimit, Runs, observe_limit
from ropeode.checking.diagnosis.rope_forces import Forces, has_rope_forces, right_terms
from ropeode.checking.report import Diagnosis
from ropeode.checking.trajectories.convergence import first_frames
from ropeode.checking.written_precision import rounding_of
from ropeode.norms import NORMS
from ropeode.precision import in_float64
from ropeode.problems import Problem
from ropeode.references import Reference
from ropeode.theory import is_rope
from ropeode.theory.terms import TERMS

# At first a motion depends on the parameters most simply, and later frames add little. With
# fewer than three frames none could be kept back to confirm what the others say.
_MOST_FRAMES, _FEWEST_FRAMES = 6, 3
# By how much of its spread a number that is not simple may be rounded.
_PART = 0.1
# Of ropes that move the same so many are said.
_MOST_SAID = 3
# How closely the acceleration of a problem is that of a rope.
_SAME = 1e-9


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
    if not _moves_as_rope(problem, reference):
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
    bounds = [reference.bound(NORMS[f"{name}-max"])[frames] for name in limit.problem.quantities]
    if limit.misfit(beginning.states, np.reshape(bounds, (-1, 1, 1))) <= 1.0:
        return _unknown(
            f"the runs tend to the right solution over the first {first_frames(frames)}, with "
            f"order {orders or 'none'}; runs of a single problem cannot show why the order is too "
            "low"
        )
    if limit.stands_still(beginning):
        return _unknown("the rope stops moving as dt goes to 0")
    if frames < _FEWEST_FRAMES:
        return _unknown(
            f"the runs tend to a wrong solution, but their limit is certain enough for a fit only "
            f"over the first {first_frames(frames)}, too few to keep some back to confirm it; use "
            "smaller steps, or samples at shorter intervals"
        )
    confirmed = _confirmed(limit, frames, runs, beginning)
    if not confirmed:
        return _unknown(
            "the runs tend to a wrong solution; no change of gravity, damping, springs, mass or "
            "initial velocity explains it"
        )
    return _diagnosis(limit.problem, confirmed)


def _moves_as_rope(problem: Problem, reference: Reference) -> bool:
    """Whether the acceleration of a problem is that of a rope with springs, and nothing else."""
    if not (is_rope(problem) and has_rope_forces(problem)):
        return False
    for t, y in zip(problem.ts[: _MOST_FRAMES + 1], reference.states, strict=False):
        own = np.asarray(problem.rhs(t, y, problem.args))[1]
        known = Forces(problem.args, right_terms(1))(*y[:, None])[0]
        if np.max(np.abs(own - known)) > _SAME * np.max(np.abs(known), initial=1e-300):
            return False
    return True


@dataclasses.dataclass(frozen=True)
class _Solved:
    """A rope that a program solves.

    Arguments:
        numbers: that differ from the right ones.
        orders: of each quantity, observed against the motion of this rope.
        bound: the estimated error of that motion, in positions.
        misfit: the largest difference between it and the limit of the runs, in units of the
            limit's uncertainty.
    """

    numbers: tuple[Number, ...]
    orders: dict[str, ObservedOrder]
    bound: float
    misfit: float


def _confirmed(
    limit: ObservedLimit, frames: int, runs: Runs, reference: Reference
) -> list[_Solved]:
    """The ropes with the fewest changes, fitted to the beginning, that also predict the rest.

    There may be several that move alike, between which the runs cannot decide.
    """
    uncertainty = limit.uncertainty.copy()
    uncertainty[-(frames // 3) :] = np.inf
    beginning = dataclasses.replace(limit, uncertainty=uncertainty)
    fitting = Fitting.to_limit(limit)
    for first in Fitting.to_limit(beginning).explaining(groups_of(limit.problem)):
        confirmed = []
        for fit in fitting.refined(first):
            before = next(each for each in first if each.groups == fit.groups)
            if fit.explains and _agree(before, fit):
                confirmed.append(_solved(limit, fit, runs, reference))
        if found := [each for each in confirmed if each is not None]:
            # The simplest numbers come first.
            return sorted(found, key=lambda each: sum(number.digits for number in each.numbers))
    return []


def _agree(first: Fit, second: Fit) -> bool:
    """Whether two fits of the same terms agree within their spreads."""
    return bool(np.all(np.abs(first.changes - second.changes) <= first.spread + second.spread))


def _solved(limit: ObservedLimit, fit: Fit, runs: Runs, reference: Reference) -> _Solved | None:
    """The rope of a fit, if the runs converge to its motion; None if they do not."""
    problem, fitted = limit.problem, numbers_of(limit.problem, fit)
    # Simple numbers that are each within their spread may together be off by more.
    for numbers in (
        tuple(simplified(problem, number) for number in fitted),
        tuple(rounded(number, _PART) for number in fitted),
        fitted,
    ):
        values = {name: value for each in numbers for name, value in each.values().items()}
        _, moved_to, error = motion_to(problem, terms_with(values), FINEST)
        states = np.concatenate([problem.y0[None], moved_to])
        misfit = limit.misfit(states, error)
        if misfit <= 1.0:
            break
    else:
        return None
    # Only its states differ: what they are compared with is this rope.
    solution = dataclasses.replace(reference, states=states)
    orders = {name: _order(solution, error, runs, name, limit.uncertainty) for name in limit.orders}
    if any(order.verdict == "does not converge" for order in orders.values()):
        return None
    bound = float(np.max(problem.quantity("position", error)))
    return _Solved(numbers, orders, bound, misfit)


def _order(
    solution: Reference, error: np.ndarray, runs: Runs, name: str, uncertainty: np.ndarray
) -> ObservedOrder:
    """Observed against a motion whose numbers are as uncertain as the limit."""
    problem, norm = solution.problem, NORMS[f"{name}-max"]
    unknown = float(np.max(problem.quantity(name, uncertainty)))
    unknown += float(np.max(problem.quantity(name, error)))
    errors = [
        float(np.max(distances(states, solution, norm)[1:]))
        if np.all(np.isfinite(problem.quantity(name, states)))
        else None
        for _, states in runs
    ]
    return observed_order(
        [dt for dt, _ in runs],
        errors,
        resolution=RESOLUTION_FACTOR * unknown,
        motion=moved(solution, norm, len(solution.states) - 1),
    )


def _diagnosis(problem: Problem, solved: Sequence[_Solved]) -> Diagnosis:
    """The diagnosis that a program solves a rope with other numbers.

    Arguments:
        problem: that it should solve.
        solved: ropes between which the runs cannot decide, at least one.
    """
    first, *others = solved
    unsaid = len(solved) - _MOST_SAID
    mistakes = [_mistakes(problem, each) for each in solved]
    words = [" and ".join(number.words for number in each.numbers) for each in solved]
    said = [[f"as if {each.words}" for each in several] for several in mistakes]
    line = f"your stepper solves, to {_orders_in_words(first)}, the rope with "
    if not others:
        line += ": ".join(filter(None, (words[0], "; ".join(said[0]))))
    else:
        line += "; or, which these runs cannot tell apart, with ".join(
            f"{each} ({'; '.join(texts)})" if texts else each
            for each, texts in [*zip(words, said, strict=True)][:_MOST_SAID]
        )
        line += f"; or with {unsaid} further sets of numbers" if unsaid > 0 else ""
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
    remedies = []
    if not others:  # Which of several changes is meant nobody knows.
        remedies = [each.remedy for each in mistakes[0]]
        terms = [each.group.terms[0] for each in first.numbers if not each.is_parameter]
        remedies += [TERMS[name].remedy for name in terms]
    return Diagnosis("parameters", line, evidence, "; ".join(dict.fromkeys(remedies)))


def _mistakes(problem: Problem, solved: _Solved) -> tuple[NamedMistake, ...]:
    """The mistake that would explain each number, where there is exactly one."""
    each = (named_mistakes(problem, number) for number in solved.numbers)
    return tuple(mistakes[0] for mistakes in each if len(mistakes) == 1)


def _orders_in_words(solved: _Solved) -> str:
    """The observed orders of all quantities, as integers where they are close to one."""
    texts = {name: _order_in_words(order) for name, order in solved.orders.items()}
    if len({*texts.values()}) == 1:
        return next(iter(texts.values()))
    return " and ".join(
        f"{text} ({'positions' if name == 'position' else 'velocities'})"
        for name, text in texts.items()
    )


def _order_in_words(order: ObservedOrder) -> str:
    if order.observed is None:
        return "an unknown order"
    near = round(order.observed)
    whole = abs(order.observed - near) <= ORDER_TOLERANCE
    return f"order {near if whole else f'{order.observed:.2f}'}"


def _unknown(line: str) -> Diagnosis:
    return Diagnosis("unknown", line)
