"""The cheapest runs that would show an order: tried out with steppers before they are advised."""

from __future__ import annotations

import contextlib
import itertools
import math
from collections.abc import Sequence

import numpy as np

from ropeode.checking.report import Convergence
from ropeode.checking.trajectories.convergence import order_finding, shown, unstable_steps
from ropeode.checking.trajectories.known_methods import (
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
    method: str | None,
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
        method: that its author claims, if any.
        expected: the order that follows from them.
        convergence: of the runs.
    """
    same = like_steppers(reference, finite(runs))
    words = f"the positions agree with those of {listed(same)}; " if same else ""
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
        return words + _stable(reference.problem, method, runs[-1].dt)
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
    coarser = sorted({coarsest >> k for k in range(1, coarsest.bit_length())})
    levels = round(math.log(finest / coarsest, _CLOSE))
    between = sorted({round(coarsest * _CLOSE**k) for k in range(1, levels)} - {*counts})
    windows = [
        (ladder is between, sum(steps), len(steps), steps)
        for ladder in (finer, coarser, between)
        for first, last in itertools.combinations(range(len(ladder) + 1), 2)
        if len(steps := tuple(ladder[first:last])) <= _MOST_RUNS
    ]
    return [steps for *_, steps in sorted(windows)]


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
    columns, again = runs[0].values.shape[2], [] if exact else steps_per_frame(runs)
    made = [run_as(name, reference.problem, n, columns) for n in (*steps, *again)]
    if None in made[: len(steps)]:
        return None
    known = [*(runs if exact else ()), *(run for run in made if run is not None)]
    finding, _ = order_finding(reference, sorted(known, key=lambda run: -run.dt), expected)
    convergence = finding.convergence
    if finding.status == "undetermined" or convergence is None or not _shows_an_order(convergence):
        return None
    order = convergence.orders[reference.problem.quantities[0]]
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


def _stable(problem: Problem, method: str | None, finest: float) -> str:
    """From how many steps per frame on a method is stable, and the runs to add.

    Arguments:
        problem: that the runs should solve.
        method: that they are claimed to have, if any.
        finest: the smallest step size of the runs.
    """
    words, limit, one = "", None, step_size(problem, 1)
    # Elsewhere there is no equilibrium about which a small motion could grow.
    with contextlib.suppress(InputError):
        if method is not None and problem.mechanics is not None:
            limit = stability_limit(problem, method)
            where = "no number of steps per frame that was tried"
            words = f"{method} is stable here at {where}; "
    if limit is not None:
        words = f"{method} is stable here from {counted(limit, 'step')} per frame on; "
    first = max(limit or 1, round(2 * one / finest))
    counts = [first * 2**k for k in range(_RUNS)]
    return f"{words}add {_in_words(counts)} (dt <= {one / first:.3g}) to begin with"
