"""The cheapest runs that would show an order: tried out with steppers before they are advised."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np

from ropeode.checking.report import Claims, Convergence
from ropeode.checking.trajectories.convergence import order_finding, shown, unstable_steps
from ropeode.checking.trajectories.known_methods import (
    FIRST,
    WHOLE,
    like_steppers,
    run_as,
    steps_per_frame,
)
from ropeode.checking.trajectories.run_files import Run, finite
from ropeode.errors import InputError
from ropeode.problems import Problem
from ropeode.references import Reference
from ropeode.simulation import step_size
from ropeode.steppers import as_stepper
from ropeode.study import problem_class
from ropeode.theory import stability_limit
from ropeode.validation import counted, listed

# The most runs that are advised, as many as an order takes beside runs that are off; and the most
# work in one of them, as steps times numbers in a state: less than a second. States with fewer
# numbers take as long as this many.
_MOST_RUNS, _MOST_WORK, _SMALL_STATE = 5, 2**25, 64
# The ratio of runs between those that there are.
_CLOSE = 1.25
# The widest interval of an order that is clear, as a part of its upper end.
_NARROW = 0.5
# So many further runs, each with twice the steps of the one before.
_RUNS = 3


def more_runs(
    reference: Reference,
    runs: Sequence[Run],
    claims: Claims,
    expected: int | None,
    convergence: Convergence,
) -> str:
    """What would show an order, as the end of a sentence.

    Steppers that have the same positions, as far as rounding lets this be seen, stand in for the
    program: the cheapest further runs with which each of them shows its order. If there is none,
    the reasons for which step sizes could not be used say what to try.

    Arguments:
        reference: of the problem.
        runs: of the program, from coarse to fine.
        claims: of its author.
        expected: the order that follows from them.
        convergence: of the runs.
    """
    same = like_steppers(reference, finite(runs))
    names = same
    words = f"the positions agree with those of {listed(names)}; " if same else ""
    # Runs with few digits have to be made again.
    exact = all(np.all(run.rounding == 0.0) for run in finite(runs))
    for steps in _windows(runs) if same else ():
        shown_by = (_order(reference, runs, exact, name, steps, expected) for name in same)
        orders = [*itertools.takewhile(lambda order: order is not None, shown_by)]
        if len(orders) == len(same):
            write = "" if exact else "write 17 digits, and "
            each = listed(dict.fromkeys(f"{order:.2f}" for order in orders))
            who = "they show" if len(same) > 1 else "it shows"
            return f"{words}{write}add {_in_words(steps)}, with which {who} order {each}"
    if "unstable" in unstable_steps(reference, convergence):
        return words + advice(reference.problem, claims, runs[-1].dt)
    return words + _from_reasons(convergence, runs)


def _in_words(steps: Sequence[int]) -> str:
    *others, last = steps
    with_last = listed([*others, counted(last, "step")])
    return f"{'runs' if others else 'a run'} with {with_last} per frame"


def _from_reasons(convergence: Convergence, runs: Sequence[Run]) -> str:
    """The runs that may decide, as the reasons say for which others could not be used."""
    one = step_size(runs[0].problem, 1)
    add = {dt for order in convergence.orders.values() for dt in order.add}
    steps = sorted({math.ceil(one / dt - WHOLE) for dt in add})
    finest = steps_per_frame(runs)[-1]
    return f"add {_in_words(steps or [2 * finest, 4 * finest])} to begin with"


def _windows(runs: Sequence[Run]) -> list[tuple[int, ...]]:
    """Steps per frame of runs that may be added: those with the fewest steps in all first.

    Those between the runs that there are come last: their numbers are not round.
    """
    problem, counts = runs[0].problem, steps_per_frame(runs)
    coarsest, finest = min(counts), max(counts)
    most = _MOST_WORK // (problem.frames * max(problem.y0.size, _SMALL_STATE))
    finer = [finest * 2**k for k in range(1, max(most // finest, 1).bit_length())]
    coarser = [n for k in range(coarsest.bit_length()) if 0 < (n := coarsest >> k) < coarsest]
    levels = round(math.log(finest / coarsest, _CLOSE))
    between = {round(coarsest * _CLOSE**k) for k in range(1, levels)} - {*counts}

    def windows(*ladders: Sequence[int]) -> list[tuple[int, ...]]:
        found = (
            tuple(ladder[first : first + count])
            for ladder in ladders
            for count in range(1, _MOST_RUNS + 1)
            for first in range(len(ladder) - count + 1)
        )
        return sorted(found, key=lambda steps: (sum(steps), len(steps)))

    return windows(finer, sorted(coarser)) + windows(sorted(between))


def _order(
    reference: Reference,
    runs: Sequence[Run],
    exact: bool,
    name: str,
    steps: Sequence[int],
    expected: int | None,
) -> float | None:
    """The order in positions that a stepper clearly shows with further runs; None if it does not.

    Arguments:
        reference: of the problem.
        runs: of the program.
        exact: whether they have all digits; the stepper makes others again.
        name: of the stepper, in the place of the program.
        steps: of the further runs, per frame.
        expected: the order that is claimed.
    """
    columns = runs[0].values.shape[2]

    def made_by_it(counts: Sequence[int]) -> list[Run | None]:
        return [run_as(name, reference.problem, n, columns) for n in counts]

    further = made_by_it(steps)
    own = runs if exact else made_by_it(steps_per_frame(runs))
    made = [run for run in (*own, *further) if run is not None]
    if any(run is None for run in further):
        return None
    finding, _ = order_finding(reference, sorted(made, key=lambda run: -run.dt), expected)
    if finding.status == "undetermined" or finding.convergence is None:
        return None
    if not _shows_an_order(finding.convergence):
        return None
    order = finding.convergence.orders[reference.problem.quantities[0]]
    assert order.ci95 is not None
    low, high = order.ci95
    # A program may differ a little from the stepper.
    return order.observed if high - low <= _NARROW * high else None


def _shows_an_order(convergence: Convergence) -> bool:
    """Whether all quantities converge, to the right solution."""
    return all(
        shown(each.order) and each.order.verdict == "converges" and not each.has_wrong_limit()
        for each in convergence.quantities.values()
    )


def advice(problem: Problem, claims: Claims, finest: float) -> str:
    """From how many steps per frame on the method is stable, and the runs to add.

    Arguments:
        problem: that the runs should solve.
        claims: the method or the order that they are claimed to have.
        finest: the smallest step size of the runs.
    """
    limits = _limits(problem, claims)
    words = "; ".join(
        f"{name} is stable here from {counted(limit, 'step')} per frame on"
        if limit is not None
        else f"{name} is stable here at no number of steps per frame that was tried"
        for name, limit in limits.items()
    )
    known = [limit for limit in limits.values() if limit is not None]
    one = step_size(problem, 1)
    first = max(min(known, default=1), round(2 * one / finest))
    counts = [first * 2**k for k in range(_RUNS)]
    add = f"add {_in_words(counts)} (dt <= {one / first:.3g}) to begin with"
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
