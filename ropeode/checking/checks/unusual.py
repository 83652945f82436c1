"""Single steps where no run of a check rope comes to: unusual states, and other numbers of nodes.

What a threshold does to a ratio of lengths, speeds or masses, no change of units shows; what is
written for the check ropes alone shows on ropes of other lengths and in a plane. The errors of
single steps are held against those of steps from usual states.
"""

from __future__ import annotations

import dataclasses
import functools
import time
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from ropeode.checking.check_context import Examination
from ropeode.checking.check_ropes import DIM, acceleration, generic
from ropeode.checking.checks.local_errors import (
    LENGTHS,
    local_errors,
    rates,
    usual_errors,
    why_unknown,
)
from ropeode.checking.report import Finding
from ropeode.checking.time_limit import OutOfTime, within
from ropeode.errors import UserCodeError
from ropeode.precision import in_float64
from ropeode.problems import Mechanics, Problem
from ropeode.simulation import Method
from ropeode.validation import is_traced

# The processor time of all states, and of all ropes: a step that takes more is tried on the first
# ropes alone, at least on so many.
_SECONDS, _FEWEST = 10.0, 8
_UNKNOWN = "not known: a usual step does not follow the solution"

# How many states are drawn for each rope.
_DRAWN = 24
# Step sizes, beside the shortest time in which something changes: so many, close together.
_EVERY_LENGTH = np.geomspace(0.5, 2e-3, 64)
# With which other step sizes each is compared, by their places, and by how much its errors may be
# larger. (Where a step is divided into parts, and their number changes, errors jump.)
_NEAR, _APART, _LARGER = 5, 12, 10.0
# The errors of methods of order 1, over the lengths of steps.
_FIRST_ORDER = 0.5
# Numbers of nodes, those first that people write; in a plane one rope is enough.
_OFTEN = (2, 3, 4, 6, 7, 8, 9, 10, 16, 20, 32, 33, 50, 51, 64, 65, 66, 100, 101, 128, 129, 200, 256)
_MOST, _IN_A_PLANE = 130, 45
_SIZES = dict.fromkeys([*_OFTEN, *range(2, _MOST + 1), 201, 255, 257, 300])


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
        if usual is None:
            return count, ""
        for rope, states, words in _trials(problem):
            found = local_errors(rope, examination.method, states, LENGTHS)
            # A method may be of order 1 where masses or damping are as on no usual rope.
            first = 0.0 if rope.args is problem.args else _FIRST_ORDER * LENGTHS
            if wrong := found.too_large(np.maximum(usual, first)):
                line = found.words(*wrong, usual[wrong[1]])
                return count, f"where {words[wrong[0]]}, {line}"
            count += len(states)
        return count, _at_every_length(problem, examination.method)

    try:
        count, line = within(_SECONDS, "steps from unusual states", work)
    except UserCodeError as error:
        return Finding("far-states", "note", f"not known: {why_unknown(error)}")
    if line:
        return Finding("far-states", "fail", f"{line}; is there a threshold or a limit?")
    if not count:
        return Finding("far-states", "note", _UNKNOWN)
    line = f"from {count} unusual states, and with {len(_EVERY_LENGTH)} step sizes, "
    return Finding("far-states", "pass", f"{line}a step errs as it does from a usual one")


def _at_every_length(problem: Problem, method: Method) -> str:
    """The first error that is much larger than those with other step sizes, in words, or ""."""
    found = local_errors(problem, method, problem.y0[None], _EVERY_LENGTH)
    errors = np.log(np.maximum(found.errors, found.left)[0])
    for size in range(_APART, len(errors) - _APART):
        longer, shorter = errors[:size][-_APART:-_NEAR], errors[size + 1 :][_NEAR:_APART]
        like = 0.5 * (np.median(longer) + np.median(shorter))
        if errors[size] > np.log(_LARGER) + like:
            return f"at this step size, {found.words(0, size, np.exp(like))}"
    return ""


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


def sizes(examination: Examination) -> Finding:
    """A step on ropes of 2 to 300 nodes, in a plane and in space, errs no more than on others."""
    if examination.stepper.compiled is not None:
        return Finding("sizes", "skip", "steppers of ropeode and of libraries take any state")
    own = examination.method
    # In Python: for another number of nodes a compiled step would be compiled again.
    trial = dataclasses.replace(own.trial, compiled=False)
    method = Method(("in Python", own.key), own.stepper, trial)
    usual = usual_errors(examination.told(generic()), own)
    if usual is None:
        return Finding("sizes", "note", _UNKNOWN)
    done, refusals, started = 0, [], time.process_time()
    for nodes in _SIZES:
        if done >= _FEWEST and time.process_time() - started > _SECONDS:
            break
        what = f"{nodes} nodes in {_dim(nodes)} dimensions"
        rope, states = _rope_of(nodes, _dim(nodes))
        rope = examination.told(rope)
        work = functools.partial(local_errors, rope, method, states, LENGTHS[1:])
        try:
            found = within(_SECONDS, f"a rope of {what}:", in_float64(work))
        except OutOfTime as error:
            refusals.append(f"not known for {what}: {why_unknown(error)}")
            break
        except UserCodeError as error:
            refusals.append(f"for a rope of {what} {why_unknown(error)}")
            if len(refusals) == 2:
                # What is written for three dimensions says so itself, and may be right there. But
                # it is written for five nodes.
                return Finding("sizes", "fail", "; ".join(refusals))
            continue
        if wrong := found.too_large(usual[1:]):
            line = found.words(*wrong, usual[1:][wrong[1]])
            line = f"on a rope of {what} {line}; is a number of nodes or dimensions fixed?"
            error, node = float(found.errors[wrong]), int(found.node[wrong])
            return Finding("sizes", "fail", line, {"error": error, "node": node})
        done += 1
    line = f"on ropes of {done} numbers of nodes, from 2 to 300, a step errs as on five nodes"
    if done < len(_SIZES) - len(refusals):
        line = f"on ropes of {done} numbers of nodes a step errs as on five; others take too long"
    return Finding("sizes", "pass", "; ".join([line, *refusals]))


def _dim(nodes: int) -> int:
    return 2 if nodes == _IN_A_PLANE else DIM


class _InNumPy:
    """The acceleration of check ropes, which NumPy need not compile for each number of nodes."""

    def __call__(self, t: Any, x: Any, v: Any, args: Any) -> Any:
        return acceleration(t, x, v, args)

    def in_numpy(self, t: Any, x: Any, v: Any, args: Any) -> Any:
        if is_traced((t, x, v, args)):
            return self(t, x, v, args)
        drive = args.drive * np.cos(args.frequency * t)
        return rates(np.stack([x, v]), args)[1] + args.free[:, None] * drive


@functools.cache
def _mechanics() -> Mechanics:
    own = generic().require_mechanics("problem")
    return dataclasses.replace(own, acceleration=_InNumPy())


def _rope_of(nodes: int, dim: int) -> tuple[Problem, np.ndarray]:
    """A random rope of so many nodes, of which every tenth is pinned or so, and a state of it."""
    random = np.random.default_rng(nodes)
    free = np.where(random.random(nodes) < 0.1, 0.0, 1.0)
    free[random.integers(nodes)] = 1.0
    rest_length = random.uniform(0.5, 1.2, nodes - 1)
    # It goes to and fro, so that no position is a large number.
    along = np.ones(dim) + 0.5 * random.normal(size=(1, nodes - 1, dim))
    along *= (-1.0) ** np.arange(nodes - 1)[:, None]
    lengths = rest_length * random.uniform(0.7, 1.5, along.shape[:2])
    along *= (lengths / np.linalg.norm(along, axis=2))[..., None]
    x = np.pad(np.cumsum(along, axis=1), ((0, 0), (1, 0), (0, 0)))
    v = random.normal(size=x.shape) * free[:, None]
    states = np.stack([x, v], axis=1)
    args = generic().args._replace(
        mass=random.uniform(0.5, 1.8, nodes),
        stiffness=random.uniform(2.0, 5.5, nodes - 1),
        rest_length=rest_length,
        free=free,
        gravity=random.normal(size=dim),
        damping=random.uniform(0.1, 0.5, nodes),
        drive=np.zeros(dim),
    )
    name = f"rope of {nodes} nodes"
    return generic().changed(y0=states[0], args=args, name=name, mechanics=_mechanics()), states
