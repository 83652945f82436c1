"""The fewest runs that would show an order: tried out with steppers before they are advised."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from ropeode.analysis.errors import distances
from ropeode.analysis.roundoff import largest_distance
from ropeode.checking.report import Claims, Convergence
from ropeode.checking.trajectories.convergence import (
    order_finding,
    shown,
    unstable_steps,
    worst_rounding,
)
from ropeode.checking.trajectories.instability import advice
from ropeode.checking.trajectories.layout import samples_of
from ropeode.checking.trajectories.run_files import Run
from ropeode.norms import NORMS, motion
from ropeode.problems.problem import Problem
from ropeode.progress import silent
from ropeode.references.reference import Reference
from ropeode.simulation import simulate, step_size
from ropeode.steppers import STEPPERS, as_stepper
from ropeode.study.accuracy_table import problem_class
from ropeode.validation import listed

# A program is a stepper if its positions are, to this part of their errors; rounding may be a
# larger part, where it is still the errors that are compared.
_SAME, _TELLING = 0.01, 0.1
# Other starts than the default that programs are likely to have.
_VARIANTS = ("stormer-verlet:start=rest", "constraint-verlet:start=rest")
# The most runs that are advised; and the most work in one of them, as steps times numbers in a
# state: less than a second. States with fewer numbers take as long as this many.
_MOST_RUNS, _MOST_WORK, _SMALL_STATE = 4, 2**25, 64
# The ratio of runs between those that there are.
_CLOSE = 1.25
# How far from a whole number the steps in a frame may be, by rounding of dt.
_WHOLE = 1e-3


def more_runs(
    reference: Reference,
    runs: Sequence[Run],
    claims: Claims,
    expected: int | None,
    convergence: Convergence,
) -> str:
    """What would show an order, as the end of a sentence.

    If the runs are those of a stepper of ropeode, further runs of that stepper show which ones
    suffice. Otherwise the stepper that the program is claimed to be stands in for it, or all that
    have its order. If none shows an order, the reasons for which step sizes could not be used
    say what is needed.

    Arguments:
        reference: of the problem.
        runs: of the program, from coarse to fine.
        claims: of its author.
        expected: the order that follows from them.
        convergence: of the runs.
    """
    same = _same_steppers(reference, runs)
    words = f"the positions are those of {listed(actor.name for actor in same)}; " if same else ""
    actors = same[:1] or _stand_ins(runs, claims)
    # Runs with few digits have to be made again.
    exact = all(np.all(run.rounding == 0.0) for run in runs)
    kept = runs if same and exact else None
    for steps in _windows(runs) if actors else ():
        if orders := _orders(reference, kept, actors, steps, expected, _counts(runs)):
            each = " and ".join(
                f"{actor.name} shows order {order:.2f}"
                for actor, order in zip(actors, orders, strict=True)
            )
            if same:
                each = f"{'they show' if len(same) > 1 else 'it shows'} order {orders[0]:.2f}"
            write = "" if exact else "write 17 digits, and "
            return f"{words}{write}add {_in_words(steps)}, with which {each}"
    if unstable_steps(convergence):
        return words + advice(reference.problem, claims, runs[-1].dt)
    return words + _from_reasons(convergence, runs)


def _in_words(steps: Sequence[int]) -> str:
    return f"{'runs' if len(steps) > 1 else 'a run'} with {listed(steps)} steps per frame"


def _from_reasons(convergence: Convergence, runs: Sequence[Run]) -> str:
    """The runs that may decide, as the reasons say for which others could not be used."""
    add = sorted({dt for order in convergence.orders.values() for dt in order.add}, reverse=True)
    if not add:
        return "add runs over a wider range of step sizes"
    one = step_size(runs[0].problem, 1)
    return f"add {_in_words([math.ceil(one / dt - _WHOLE) for dt in add])}"


class _Actor:
    """A stepper in the place of the program.

    Arguments:
        name: of the stepper.
        problem: that it solves.
        columns: of its runs, which have velocities or not.
    """

    def __init__(self, name: str, problem: Problem, columns: int):
        self.name, self.problem, self.columns = name, problem, columns
        self._runs: dict[int, Run | None] = {}

    def run(self, steps: int) -> Run | None:
        """Its run with so many steps per frame; None if that diverges."""
        if steps not in self._runs:
            made = simulate(self.problem, self.name, steps, progress=silent)
            values = samples_of(self.problem, made.states)[:, :, : self.columns]
            path, frame = Path(f"{steps}.csv"), step_size(self.problem, 1)
            run = Run(self.problem, path, made.dt, values, frame) if made.status == "ok" else None
            self._runs[steps] = run
        return self._runs[steps]


def _actors(names: Iterable[str], runs: Sequence[Run]) -> list[_Actor]:
    """The steppers of these names that solve the problem of some runs."""
    problem = runs[0].problem
    kind, columns = problem_class(problem), runs[0].values.shape[2]
    return [
        _Actor(name, problem, columns)
        for name in names
        if (stepper := as_stepper(name)).solves(kind) and stepper.refusal(problem) is None
    ]


def _counts(runs: Sequence[Run]) -> list[int]:
    """The steps per frame of runs, rounded up."""
    one = step_size(runs[0].problem, 1)
    return [math.ceil(one / run.dt - _WHOLE) for run in runs]


def _same_steppers(reference: Reference, runs: Sequence[Run]) -> list[_Actor]:
    """Steppers whose positions are those of all runs, until these blow up."""
    counts, one = _counts(runs), step_size(runs[0].problem, 1)
    if any(abs(one / run.dt - n) > _WHOLE for run, n in zip(runs, counts, strict=True)):
        return []
    return [
        actor
        for actor in _actors((*STEPPERS, *_VARIANTS), runs)
        if all(
            (made := actor.run(n)) is not None and _agree(reference, run, made)
            for run, n in zip(runs, counts, strict=True)
        )
    ]


def _agree(reference: Reference, run: Run, made: Run) -> bool:
    """Whether two runs have the same positions, but for a small part of their errors."""
    problem, norm = reference.problem, NORMS[f"{reference.problem.quantities[0]}-max"]
    errors = distances(run.states, reference, norm)
    blown_up = errors > motion(problem, reference.states, norm)[reference.trusted - 1]
    end = int(np.argmax(blown_up)) if blown_up.any() else len(errors)
    apart = largest_distance(problem, norm, run.states[:end], made.states[:end])
    rounding = float(np.linalg.norm(worst_rounding(run, reference)[: run.layout.dim]))
    largest = float(np.max(errors[:end]))
    return rounding < _TELLING * largest and apart <= max(_SAME * largest, rounding)


def _stand_ins(runs: Sequence[Run], claims: Claims) -> list[_Actor]:
    """The stepper that a program is claimed to be, or those that have its order."""
    if claims.method is not None:
        return _actors([claims.method], runs)
    kind = problem_class(runs[0].problem)
    return _actors(
        [name for name in STEPPERS if as_stepper(name).order(kind) == claims.order], runs
    )


def _windows(runs: Sequence[Run]) -> list[tuple[int, ...]]:
    """Steps per frame of runs that may be added: the fewest runs first, then the fewest steps.

    Those between the runs that there are come last: their numbers are not round.
    """
    problem, counts = runs[0].problem, _counts(runs)
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
        return sorted(found, key=lambda steps: (len(steps), sum(steps)))

    return windows(finer, sorted(coarser)) + windows(sorted(between))


def _orders(
    reference: Reference,
    runs: Sequence[Run] | None,
    actors: Sequence[_Actor],
    steps: Sequence[int],
    expected: int | None,
    counts: Sequence[int],
) -> list[float] | None:
    """The order in positions that each actor shows with further runs; None if one shows none.

    Arguments:
        reference: of the problem.
        runs: of the program; None where the actors make these, too.
        actors: in its place.
        steps: of the further runs.
        expected: the order that is claimed.
        counts: the steps per frame that there are already.
    """
    found = []
    for actor in actors:
        further = [run for n in steps if (run := actor.run(n)) is not None]
        if len(further) < len(steps):
            return None
        own = runs or [run for n in counts if (run := actor.run(n)) is not None]
        all_runs = sorted([*own, *further], key=lambda run: -run.dt)
        finding, _ = order_finding(reference, all_runs, expected)
        convergence = finding.convergence
        if convergence is None or finding.status == "undetermined":
            return None
        if not all(map(shown, convergence.orders.values())):
            return None
        found.append(convergence.orders[reference.problem.quantities[0]].observed)
    return found
