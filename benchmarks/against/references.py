"""Reference solutions: the time to one true error, with and without a certificate."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Iterator
from typing import Any, NamedTuple

import jax
import numpy as np

from against import right_hand_sides
from against.solvers import Make, Solver, families, quietly
from against.timing import Contender, Peers, clocked, race
from ropeode import Problem, ReferenceRefused, load, reference
from ropeode.norms import distance, norm_for
from ropeode.references import SMALLEST_RTOL

CERTIFIED = "reference, with its certificate"
# From loose to tight, two for each digit.
TOLERANCES = [10.0 ** (-k / 2) for k in range(6, 33)]


class Case(NamedTuple):
    """A problem whose solution is stored to the last bit.

    Fields:
        stored: its name in ropeode's library.
        frames: of which so many are solved.
        words: what it is.
        stiff: whether implicit solvers are the right ones.
    """

    stored: str
    frames: int
    words: str
    stiff: bool = False


CASES = (
    Case("rope-damping-0.01", 20, "default rope, 20 frames"),
    Case("rope-stiff", 2, "rope with stiffness 1e6, 2 frames"),
    Case("kepler", 90, "Kepler, eccentricity 0.9, 3 periods"),
    Case("van-der-pol", 40, "Van der Pol, epsilon 1e-6", stiff=True),
)


class Size(NamedTuple):
    """How much is run.

    Fields:
        cases: problems.
        accuracies: true errors to reach, in the units of the positions, from large to small.
        certified: of these, where the whole reference is made as well.
        rounds: of each case.
        budget: seconds, after which a case makes no more than the fewest rounds.
    """

    cases: tuple[Case, ...] = CASES
    accuracies: tuple[float, ...] = (1e-6, 1e-9, 1e-11)
    certified: tuple[float, ...] = (1e-6, 1e-9)
    rounds: int = 7
    budget: float = 5.0


class Found(NamedTuple):
    """The loosest tolerance that reaches an accuracy.

    Fields:
        make: the method.
        rtol: the tolerance.
        seconds: of one run.
    """

    make: Make
    rtol: float
    seconds: float


class Truth(NamedTuple):
    """A problem with the states that are its solution, ``(times, *state)``."""

    problem: Problem
    states: np.ndarray

    def error(self, states: np.ndarray | None) -> float:
        """The largest error of positions over all samples; infinite where there are none."""
        if states is None:
            return np.inf
        norm = norm_for(self.problem)
        return float(np.max(distance(self.problem, norm, states, self.states)))


def truth(case: Case) -> Truth:
    """From extended precision, rounded to float64."""
    known = load(case.stored)
    assert known.certificate.level == "extended", case
    assert known.trusted == len(known.problem.ts), case
    problem = dataclasses.replace(known.problem, ts=known.problem.ts[: case.frames + 1])
    return Truth(problem, known.states[: case.frames + 1])


def loosest(
    methods: list[Make], side: Any, known: Truth, accuracies: tuple[float, ...]
) -> dict[float, Found]:
    """For each accuracy that is reached: the fastest method, at its loosest tolerance."""
    best: dict[float, Found] = {}
    for make in methods:
        solver, missing = make(side), list(accuracies)
        for rtol in TOLERANCES:
            if not missing or rtol < solver.tightest:
                break
            if known.error(quietly(solver, rtol)) > missing[0]:
                continue
            started = time.perf_counter()
            error = known.error(quietly(solver, rtol))
            seconds = time.perf_counter() - started
            while missing and error <= missing[0]:
                accuracy = missing.pop(0)
                if accuracy not in best or seconds < best[accuracy].seconds:
                    best[accuracy] = Found(make, rtol, seconds)
    return best


def facts(solver: Solver, rtol: float, known: Truth) -> dict[str, Any]:
    """What is told of a solver at a tolerance, once it is ready to run."""
    return {
        "rhs": solver.rhs,
        "tolerance": rtol,
        "true_error": known.error(quietly(solver, rtol)),
        "evaluations": solver.count(rtol) if solver.count else None,
    }


def contender(solver: Solver, found: Found, known: Truth, accuracy: float) -> Contender | None:
    """A solver at the tolerance that was found, or a tighter one if rounding needs it."""
    for rtol in (rtol for rtol in TOLERANCES if solver.tightest <= rtol <= found.rtol):
        compile_seconds = solver.compile_seconds + solver.prepare(rtol)
        told = facts(solver, rtol, known)
        if told["true_error"] <= accuracy:
            told["compile_seconds"] = compile_seconds
            run = clocked(lambda rtol=rtol: solver.solve(rtol))
            return Contender(solver.by, solver.how, run, told)
    return None


def certified(known: Truth, rtol: float, budget: float) -> Contender | None:
    """The whole of `ropeode.reference`; None where it takes no such tolerance or refuses.

    Arguments:
        known: the problem and its solution.
        rtol: of the primary run.
        budget: seconds, above which it is not run again to be timed.
    """
    if rtol < SMALLEST_RTOL:
        return None
    started = time.perf_counter()
    try:
        made = reference(known.problem, rtol=rtol)
    except ReferenceRefused:
        return None
    seconds = time.perf_counter() - started
    if made.trusted < len(known.states):
        return None
    return Contender(
        "ropeode",
        CERTIFIED,
        clocked(lambda: reference(known.problem, rtol=rtol)),
        {
            "rhs": "",
            "tolerance": rtol,
            "true_error": known.error(made.states),
            "bound": float(made.bound()[-1]),
        },
        measured=seconds if seconds > budget else None,
    )


def solved(case: Case, size: Size, peers: Peers) -> list[dict[str, Any]]:
    """A table for each accuracy."""
    known = truth(case)
    sides = right_hand_sides.quickest_first(known.problem, peers)
    every = families(known.problem, stiff=case.stiff, peers=peers)
    found = [loosest(methods, sides[0], known, size.accuracies) for methods in every]
    tables = []
    for accuracy in size.accuracies:
        contenders, missed = [], []
        for methods, best in zip(every, found, strict=True):
            if accuracy not in best:
                missed += [f"{each.by} {each.how}" for each in (m(sides[0]) for m in methods)]
                continue
            make = best[accuracy].make
            solver = make(sides[0])
            for side in sides if solver.rhs else sides[:1]:
                ready = contender(make(side), best[accuracy], known, accuracy)
                if ready is None:
                    missed.append(f"{solver.by} {solver.how}, {side.name}")
                    continue
                contenders.append(ready)
            if solver.by == "ropeode" and accuracy in size.certified:
                whole = certified(known, best[accuracy].rtol, size.budget)
                contenders += [whole] if whole else []
        tables.append(
            {
                "part": "references",
                "case": f"{case.words}, true error <= {accuracy:g}",
                "unit": "ms",
                "missed": missed,
                "rows": race(contenders, size.rounds, budget=size.budget, scale=1e3),
            }
        )
    return tables


def run(size: Size, peers: Peers) -> Iterator[dict[str, Any]]:
    """All problems."""
    with jax.enable_x64(True):
        for case in size.cases:
            yield from solved(case, size, peers)
