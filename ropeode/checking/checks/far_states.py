"""Steps from states that no run comes to: springs that are torn apart, nodes that hardly move.

What a threshold does to a ratio of lengths, speeds or masses, no change of units shows. The errors
of single steps, of many lengths, are held against those of steps from usual states.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from ropeode.checking.check_context import Examination
from ropeode.checking.check_ropes import generic
from ropeode.checking.checks.local_errors import (
    LENGTHS,
    LocalErrors,
    errs_by,
    has_usual_errors,
    local_errors,
    too_large,
    usual_errors,
    why_unknown,
)
from ropeode.checking.report import Finding
from ropeode.checking.time_limit import within
from ropeode.errors import UserCodeError
from ropeode.problems import Problem

# How many states are drawn for each rope.
_DRAWN = 24
# Step sizes, beside the shortest time in which something changes: so many, close together.
_EVERY_LENGTH = np.geomspace(0.5, 2e-3, 64)
# With which other step sizes each is compared, by their places, and by how much its errors may be
# larger. (Where a step is divided into parts, and their number changes, errors jump.)
_NEAR, _APART, _LARGER = 5, 12, 10.0
# The errors of methods of order 1, over the lengths of steps.
_FIRST_ORDER = 0.5
# The processor time of all steps; see `scales`.
_SECONDS = 10.0


class _Trial(NamedTuple):
    """A rope, states of it, and what is unusual about each."""

    problem: Problem
    states: np.ndarray
    words: list[str]


def far_states(examination: Examination) -> Finding:
    """A step from an unusual state errs no more than from a usual one, however long it is."""
    problem = examination.told(generic())

    def work() -> tuple[int, str]:
        usual, count = usual_errors(problem, examination.method), 0
        if not has_usual_errors(usual):
            return count, ""
        for rope, states, words in _trials(problem):
            found = local_errors(rope, examination.method, states, LENGTHS)
            # A method may be of order 1 where masses or damping are as on no usual rope.
            first = 0.0 if rope.args is problem.args else _FIRST_ORDER * LENGTHS
            wrong = too_large(found, np.maximum(usual, first))
            if np.any(wrong):
                state, size = np.argwhere(wrong)[0]
                return count, _words(found, usual, state, size, f"where {words[state]}")
            count += len(states)
        found = local_errors(problem, examination.method, problem.y0[None], _EVERY_LENGTH)
        errors = np.log(np.maximum(found.errors, found.left)[0])
        for size in range(_APART, len(errors) - _APART):
            longer, shorter = errors[:size][-_APART:-_NEAR], errors[size + 1 :][_NEAR:_APART]
            like = 0.5 * (np.median(longer) + np.median(shorter))
            if errors[size] > np.log(_LARGER) + like:
                usual = np.full(len(errors), np.exp(like))
                return count, _words(found, usual, 0, size, "at this step size")
        return count, ""

    try:
        count, line = within(_SECONDS, "steps from unusual states", work)
    except UserCodeError as error:
        return Finding("far-states", "note", f"not known: {why_unknown(error)}")
    if line:
        return Finding("far-states", "fail", f"{line}; is there a threshold or a limit?")
    if not count:
        line = "not known: a usual step does not follow the solution"
        return Finding("far-states", "note", line)
    line = f"from {count} unusual states, and with {len(_EVERY_LENGTH)} step sizes, "
    return Finding("far-states", "pass", f"{line}a step errs as it does from a usual one")


def _words(found: LocalErrors, usual: np.ndarray, state: int, size: int, where: str) -> str:
    error, dt = found.errors[state, size], found.dt[state, size]
    return (
        f"{where}, a step (dt = {dt:.2g}) {errs_by(error)}, most at node "
        f"{found.node[state, size]}, where {usual[size]:.1e} is usual"
    )


def _trials(problem: Problem) -> Iterator[_Trial]:
    """States of ropes, the named ones first."""
    named = _named(problem)
    yield _Trial(problem, np.stack(list(named.values())), list(named))
    random = np.random.default_rng(1)
    some = np.array([0.0, 30.0, 0.0, 0.1, 4.0])
    others = {
        "": {},
        "masses are from 0.01 to 100": {"mass": np.array([5.0, 0.01, 1.0, 100.0, 12.0])},
        "a rest length is 0": {"rest_length": np.array([0.8, 0.0, 0.6, 1.2])},
        "rest lengths are long": {"rest_length": np.array([9.0, 40.0, 15.0, 20.0])},
        "damping is from 0 to 30": {"damping": some * np.any(problem.args.damping)},
    }
    for words, other in others.items():
        rope = problem.changed(args=problem.args._replace(**other)) if other else problem
        every = [_drawn(problem, random, i) for i in range(_DRAWN)]
        yield _Trial(rope, *_with_words(every, words))
    # Nothing but springs that are next to their rest lengths pulls these.
    args = problem.args._replace(gravity=np.zeros(3), damping=np.zeros(len(problem.args.mass)))
    every = [_at_rest_lengths(problem, random) for _ in range(_DRAWN)]
    yield _Trial(problem.changed(args=args), *_with_words(every, "springs are hardly stretched"))


def _with_words(every: list[tuple[np.ndarray, str]], words: str) -> tuple[np.ndarray, list[str]]:
    lines = [f"{words}, {each}" if words else each for _, each in every]
    return np.stack([y for y, _ in every]), lines


def _named(problem: Problem) -> dict[str, np.ndarray]:
    """States of a rope, each by what is unusual about it."""
    x, v = problem.y0
    pin = x[np.argmin(problem.args.free)]
    torn = x + 30.0 * (np.arange(len(x)) == len(x) - 1)[:, None]

    def stretched(ratio: float) -> np.ndarray:
        return np.stack([pin + ratio * (x - pin), v])

    def moving(*factors: float) -> np.ndarray:
        return np.stack([x, v * np.array(factors)[:, None]])

    return {
        "all springs are four times as long": stretched(4.0),
        "all springs are twelve times as long": stretched(12.0),
        "all springs are forty times as long": stretched(40.0),
        "all springs are a tenth as long": stretched(0.1),
        "one spring is forty times as long": np.stack([torn, v]),
        "the rope is at rest": moving(0.0, 0.0, 0.0, 0.0, 0.0),
        "a node hardly moves": moving(1.0, 1.0, 1e-6, 1.0, 1.0),
        "a node moves a million times as slowly as others": moving(1e3, 1.0, 1e-3, 1e3, 1e3),
        "a node moves a thousand times as fast as others": moving(1.0, 1.0, 1.0, 1e3, 1.0),
    }


def _drawn(problem: Problem, random: np.random.Generator, i: int) -> tuple[np.ndarray, str]:
    """A state, every other one with springs that are all stretched alike."""
    ratios = np.exp(random.uniform(np.log(0.02), np.log(100.0), len(problem.args.stiffness)))
    if i % 2:
        ratios[:] = ratios[0]
    speeds = np.exp(random.uniform(np.log(1e-4), np.log(100.0), len(problem.args.mass)))
    words = (
        f"springs are {ratios.min():.2g} to {ratios.max():.2g} times as long as in {problem.name!r}"
    )
    return _scaled(problem, ratios, speeds), words


def _scaled(problem: Problem, ratios: np.ndarray, speeds: np.ndarray) -> np.ndarray:
    x, v = problem.y0
    along = np.cumsum(np.diff(x, axis=0) * ratios[:, None], axis=0)
    return np.stack([np.vstack([x[:1], x[:1] + along]), v * speeds[:, None]])


def _at_rest_lengths(problem: Problem, random: np.random.Generator) -> tuple[np.ndarray, str]:
    """A state in which no spring is stretched by more than a small part of its length."""
    size = np.exp(random.uniform(np.log(1e-4), np.log(0.1)))
    length = np.linalg.norm(np.diff(problem.y0[0], axis=0), axis=1)
    ratios = problem.args.rest_length / length * (1.0 + size * random.normal(size=len(length)))
    return _scaled(problem, ratios, np.zeros(len(problem.args.mass))), f"by {size:.0e}"
