"""Thresholds: steps from states, in units and on ropes that no run of a check comes to.

A speed below which a node is put to rest, a step size from which on another formula holds, a limit
on forces, a spring that breaks at three times its length, a loop over the five nodes of the check
ropes: each is a number, and beyond it a step errs more than others do. Units of length, mass and
time change every number that has a unit; unusual states and parameters change ratios. All cases
are held against steps of the same length from usual states.

A step that divides dt into parts, or adapts them to a tolerance, errs more in some units than in
others, too. Unlike one beyond a threshold it errs less with shorter steps, as its order says.
"""

from __future__ import annotations

import dataclasses
import functools
import math
import time
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from ropeode.checking.check_context import Examination
from ropeode.checking.check_ropes import DIM, NODES, Units, generic, rates
from ropeode.checking.checks.local_errors import Case, LocalErrors, local_errors, why_unknown
from ropeode.checking.report import Finding
from ropeode.checking.time_limit import OutOfTime, within
from ropeode.errors import UserCodeError
from ropeode.precision import in_float64
from ropeode.problems import Problem
from ropeode.simulation import Method
from ropeode.theory import bisected

# How long steps are beside the shortest time in which something changes. The last ones fill an
# octave: in units of time that are powers of two there is a step size in every interval of 15 %.
LENGTHS = np.array([1e-4, 1e-3, 0.02, *0.15 * 2.0 ** (-np.arange(5) / 5)])
# Of those, the ones on ropes of other numbers of nodes.
_OF_LONG_ROPES = [1, 2]
# Errors of right steps from usual states differ by a factor of 5, whatever the method.
_MORE = 15.0
_USUAL = 12
# With so many times as many steps errors must fall with the order of the method less a margin.
_FINER, _MARGIN = (1, 8, 32), 0.5
# The processor time of a case: a step that iterates to a tolerance which rounding cannot reach does
# not return. That of all cases of a kind, of which so many are always tried; and after so many that
# are not known no more are.
_SECONDS, _ALL_SECONDS, _FEWEST, _MOST_UNKNOWN = 2.0, 10.0, 8, 3
_TOO_LONG = " (others take too long)"
# How closely a threshold is found on the way to it, and how close to a number of two digits it is
# then; a step in which nothing moves, and what it may err by.
_BISECTED, _CLOSE, _NO_WAY, _NO_WAY_ERRS = 2.0**-40, 1e-5, 1e-7, 1e-6
_TINY, _WAYS = 1e-300, 6
# How many states are drawn for each rope.
_DRAWN = 12
# The errors of methods of order 1, over the lengths of steps.
_FIRST_ORDER = 0.5
# Powers of two of the units of length, mass and time that are changed one by one: short steps at
# high speeds; long steps at low ones, where masses grow so that forces are not that small; large
# ropes and long steps at the usual speeds; large and small forces; small ropes.
_POWERS = [
    *np.outer(range(1, 25), (0, 0, -1)),
    *np.outer(range(1, 25), (0, 1, 1)),
    *np.outer(range(1, 25), (1, 0, 1)),
    *np.outer(range(-30, 31, 5), (0, 1, 0)),
    (-8, 0, 0),
]
# How many units of everything at once are drawn, for a threshold may be one of two numbers, and
# between which powers, of speed, length and mass; how late and how far away a step may be.
_DRAWN_UNITS, _AT_ONCE = 64, ((-20, 20), (-6, 20), (-30, 30))
_LATE, _AWAY = 20, 10
# Numbers of nodes, those first that people write; in a plane one rope is enough.
_OFTEN = (2, 3, 4, 6, 7, 8, 9, 10, 16, 20, 32, 33, 50, 51, 64, 65, 66, 100, 101, 128, 129, 200, 256)
_IN_A_PLANE = 45
_SIZES = dict.fromkeys([*_OFTEN, *range(2, 41), _IN_A_PLANE, 201, 255, 257, 300])


class _Usual(NamedTuple):
    """What steps from usual states err by.

    Fields:
        errors: as parts of the way, for each of `LENGTHS`.
        order: with which they fall, or the one that is claimed.
    """

    errors: np.ndarray
    order: float


def thresholds(examination: Examination) -> Finding:
    """A step errs no more than a usual one, whatever the state, the units and the rope."""
    told, own = examination.told, examination.method
    problem = told(generic())
    every = list(range(len(LENGTHS)))
    hunts = [
        ("from {} unusual states", _unusual_states(problem), own, every),
        ("in {} units of length, mass and time", _other_units(problem), own, every),
    ]
    # Steppers of ropeode and of libraries take any number of nodes.
    if examination.stepper.compiled is None:
        # In Python: for another number of nodes a compiled step would be compiled again.
        trial = dataclasses.replace(own.trial, compiled=False)
        in_python = Method(("in Python", own.key), own.stepper, trial)
        sizes = (_of_nodes(nodes, told) for nodes in _SIZES)
        words = "on ropes of {} numbers of nodes from 2 to 300"
        hunts.append((words, sizes, in_python, _OF_LONG_ROPES))
    done, unknown, refusals = [], [], []
    try:
        usual = _usual(problem, examination)
    except UserCodeError as error:
        return Finding("thresholds", "note", f"not known: {why_unknown(error)}")
    if not np.all(usual.errors < 1.0):
        line = "not known: a usual step does not follow the solution"
        return Finding("thresholds", "note", line)
    for words, cases, method, which in hunts:
        count, started = 0, time.process_time()
        for tried, case in enumerate(cases):
            nodes, dim = case.states.shape[2:]
            if tried >= _FEWEST and time.process_time() - started > _ALL_SECONDS:
                words += _TOO_LONG
                break
            work = functools.partial(_what_is_wrong, case, method, usual, which)
            # One that runs in Python may have to compile what it calls, for each number of nodes.
            seconds = _SECONDS if nodes == NODES else _ALL_SECONDS
            try:
                line = within(seconds, "a step", in_float64(work))
            except UserCodeError as error:
                if nodes == NODES:
                    unknown.append(f"not known {_where(case)}: {why_unknown(error)}")
                elif isinstance(error, OutOfTime):
                    words += _TOO_LONG
                    break
                else:
                    rope = f"for a rope of {nodes} nodes in {dim} dimensions"
                    refusals.append(f"{rope} {why_unknown(error)}")
                # What is written for three dimensions says so itself, and may be right there. But
                # it is written for five nodes.
                if len(refusals) > 1:
                    return Finding("thresholds", "fail", "; ".join(refusals))
                if len(unknown) > _MOST_UNKNOWN:
                    break
                continue
            if line:
                return Finding("thresholds", "fail", line)
            count += len(case.states)
        done.append(words.format(count))
    line = f"{', '.join(done)}, a step errs as a usual one"
    line = "; ".join([*unknown[:1], line, *refusals])
    return Finding("thresholds", "note" if unknown else "pass", line)


def _usual(problem: Problem, examination: Examination) -> _Usual:
    """The errors of steps from states as a rope comes to."""
    random = np.random.default_rng(0)
    size = np.array([0.1, 0.5])[:, None, None] * problem.args.free[:, None]
    states = problem.y0 + size * random.normal(size=(_USUAL, *problem.y0.shape))
    found = local_errors(Case(problem, states), examination.method, LENGTHS)
    errors = np.median(found.errors, axis=0)
    power = _power(errors[3], errors[2], LENGTHS[3] / LENGTHS[2])
    return _Usual(errors, max(power, examination.expected(problem) or 0.0))


def _what_is_wrong(case: Case, method: Method, usual: _Usual, which: list[int]) -> str:
    """The first step that errs much more than a usual one, in words; empty if there is none.

    Arguments:
        case: states.
        method: the stepper.
        usual: what steps err by.
        which: of `LENGTHS`, by their indices.
    """
    lengths = LENGTHS[which]
    most = np.maximum(usual.errors[which], case.least * lengths)
    found = local_errors(case, method, lengths)
    for state, size in np.argwhere(~(found.errors <= _MORE * most + found.left)):
        one = dataclasses.replace(case, states=case.states[state : state + 1])
        if not _vanishes(one, method, float(lengths[size]), usual.order):
            error, dt = found.errors[state, size], found.dt[state, size] * case.units.time
            errs = f"errs by {error:.1e} of its way"
            if not np.isfinite(error):
                errs = "returns a number that is not finite (nan or infinite)"
            allowed = _MORE * float(most[size])
            return (
                f"a step (dt = {dt:.2g}) {errs}, most at node {found.node[state, size]}, where "
                f"{most[size]:.1e} is usual, {_where(one)}; "
                f"{_threshold(one, method, float(lengths[size]), allowed)}"
            )
    return ""


def _threshold(case: Case, method: Method, length: float, allowed: float) -> str:
    """The number from which on steps err, in words, if it is one that people write.

    It is looked for on two ways from usual states to that of a case, and must be the same on both.

    Arguments:
        case: one state from which a step errs.
        method: the stepper.
        length: of the step.
        allowed: what it may err by.
    """
    nodes, dim = case.states.shape[2:]
    if (nodes, dim) != (NODES, DIM):
        return "is there a fixed number of nodes or dimensions?"
    # In the shortest steps nothing moves, so that numbers before and after are the same.
    for short, most, names in ((_NO_WAY, max(allowed, _NO_WAY_ERRS), ""), (length, allowed, "dt")):
        ways = (_on_the_way(case, seed) for seed in range(_WAYS))
        found = filter(None, (_borders(way, method, short, most, names) for way in ways))
        one, other = next(found, []), next(found, [])
        if both := [words for words in one if words in other]:
            return f"it does so where {both[0]}"
    return "is there a threshold or a limit, or a constant with a unit?"


def _on_the_way(case: Case, seed: int) -> Callable[[float], Case]:
    """Cases from a usual state, at 0, to another one, at 1, of a rope with numbers of its own."""
    random, args, y0 = np.random.default_rng(seed), case.rope.args, generic().y0
    usual = y0 + 0.2 * args.free[:, None] * random.normal(size=y0.shape)
    numbers = {
        name: getattr(args, name) * random.uniform(0.9, 1.1, getattr(args, name).shape)
        for name in ("mass", "stiffness", "rest_length", "damping")
    }
    rope = case.rope.changed(args=args._replace(**numbers))
    return lambda part: dataclasses.replace(
        case,
        rope=rope,
        states=usual + part * (case.states - usual),
        units=Units(*np.power(case.units, part)),
        away=part * np.asarray(case.away),
        later=part * case.later,
    )


def _borders(
    way: Callable[[float], Case], method: Method, length: float, allowed: float, name: str
) -> list[str]:
    """Which numbers of few digits a state has where steps begin to err on a way, in words.

    Arguments:
        way: cases, from 0 to 1.
        method: the stepper.
        length: of the step.
        allowed: what it may err by.
        name: of the only number that counts; empty for all.

    Returns:
        Those of the fewest digits first.
    """

    def found(part: float) -> LocalErrors:
        return local_errors(way(part), method, np.array([length]))

    def is_usual(part: float) -> bool:
        return bool(np.all(found(part).errors <= allowed))

    def numbers(part: float) -> dict[str, np.ndarray]:
        return _numbers(way(part)) | {"dt": found(part).dt[0] * way(part).units.time}

    if not is_usual(0.0) or is_usual(1.0):
        return []
    border = bisected(is_usual, 0.0, 1.0, _BISECTED)
    low, high = (numbers(border + part) for part in (0.0, 2.0 * _BISECTED))
    said = []
    for each in [name] if name else high:
        for before, value in zip(low[each], high[each], strict=True):
            digits = next((n for n in (0, 1) if _is_short(value, n)), None)
            if digits is not None and value != before:
                side = "above" if value > before else "below"
                said.append((digits, f"{each} is {side} {float(f'{value:.{digits}e}'):g}"))
    return [words for _, words in sorted(said, key=lambda pair: pair[0])]


def _is_short(value: float, digits: int) -> bool:
    return abs(value - float(f"{value:.{digits}e}")) <= _CLOSE * abs(value)


def _numbers(case: Case) -> dict[str, np.ndarray]:
    """Numbers of the only state of a case, of which a step may be tied to one, in words."""
    args, (x, v) = case.units.of(case.rope).args, case.moved[0]
    length = np.linalg.norm(np.diff(x, axis=0), axis=1)
    pull = args.stiffness * (length - args.rest_length)
    parts = {"position": x, "velocity": v, "acceleration": rates(case.moved[0], args)[1]}
    return {
        "t": np.array([case.t]),
        **{f"a node's {axis}": x[:, i] for i, axis in enumerate("xyz")},
        **{f"a component of a node's {name}": np.abs(each).ravel() for name, each in parts.items()},
        **{
            f"the size of a node's {name}": np.linalg.norm(each, axis=1)
            for name, each in parts.items()
        },
        "the length of a spring": length,
        "the length of a spring over its rest length": length / np.maximum(args.rest_length, _TINY),
        "a spring's pull": np.abs(pull),
        "a component of a spring's pull": np.abs(
            pull[:, None] * np.diff(x, axis=0) / length[:, None]
        ).ravel(),
        "the stiffness of a spring": args.stiffness,
        "the rest length of a spring": args.rest_length,
        "the mass of a node": args.mass,
        "the damping of a node": args.damping,
    }


def _vanishes(case: Case, method: Method, length: float, order: float) -> bool:
    """Whether the error of a step falls with the order of the method, as steps become shorter.

    They become shorter in two ways, so that no number leaves its threshold in both: dt does, or dt
    and all speeds stay and the rope grows.
    """
    for grows in (0, 1):
        errors = []
        for n in _FINER:
            units = case.units._replace(
                length=case.units.length * n**grows, time=case.units.time * n**grows
            )
            part = dataclasses.replace(case, units=units)
            errors.append(local_errors(part, method, np.array([length / n])).errors[0, 0])
        powers = map(_power, errors, errors[1:], np.divide(_FINER[1:], _FINER[:-1]))
        if not max(powers) >= order - _MARGIN:
            return False
    return True


def _power(coarse: float, fine: float, ratio: float) -> float:
    """Of the step size, with which an error falls; -inf where one is not a number, or 0."""
    if not (math.isfinite(coarse) and math.isfinite(fine)) or coarse == 0.0:
        return -math.inf
    return math.log(coarse / max(fine, 1e-300)) / math.log(ratio)


def _where(case: Case) -> str:
    """The numbers of a case, in words."""
    args, (nodes, dim) = case.units.of(case.rope).args, case.states.shape[2:]
    x, v = np.moveaxis(case.moved, 1, 0)
    lengths = np.linalg.norm(np.diff(x, axis=1), axis=2)
    force = np.max(args.mass) * np.max(np.abs(args.gravity))
    return (
        f"on a rope of {nodes} nodes in {dim} dimensions at t = {case.t:.2g}, where positions are "
        f"up to {np.max(np.abs(x)):.2g}, springs {_between(lengths)} long (at rest "
        f"{_between(args.rest_length)}), speeds {_between(np.linalg.norm(v, axis=2))}, masses "
        f"{_between(args.mass)}, weights up to {force:.2g}"
    )


def _between(values: np.ndarray) -> str:
    return f"{np.min(values):.2g} to {np.max(values):.2g}"


def _unusual_states(problem: Problem) -> Iterator[Case]:
    """States of ropes, those first that are unusual in one way."""
    random = np.random.default_rng(1)
    yield Case(problem, _unusual_in_one_way(problem))
    some = np.array([0.0, 30.0, 0.0, 0.1, 4.0])
    others: list[dict[str, Any]] = [
        {},
        {"mass": np.array([5.0, 0.01, 1.0, 100.0, 12.0])},
        {"rest_length": np.array([0.8, 0.0, 0.6, 1.2])},
        {"rest_length": np.array([9.0, 40.0, 15.0, 20.0])},
        {"damping": some * np.any(problem.args.damping)},
    ]
    for other in others:
        rope = problem.changed(args=problem.args._replace(**other))
        states = np.stack([_drawn(problem, random, i % 2 == 0) for i in range(_DRAWN)])
        # A method may be of order 1 where masses or damping are as on no usual rope.
        yield Case(rope, states, least=_FIRST_ORDER if other else 0.0)
    # Nothing but springs that are next to their rest lengths pulls these.
    args = problem.args._replace(gravity=np.zeros(DIM), damping=np.zeros(NODES))
    states = np.stack([_at_rest_lengths(problem, random) for _ in range(_DRAWN)])
    yield Case(problem.changed(args=args), states, least=_FIRST_ORDER)


def _unusual_in_one_way(problem: Problem) -> np.ndarray:
    x, v = problem.y0
    pin, last = x[np.argmin(problem.args.free)], np.eye(NODES)[-1][:, None]
    stretched = [np.stack([pin + ratio * (x - pin), v]) for ratio in (0.1, 4.0, 12.0, 40.0)]
    speeds = [(0, 0, 0, 0, 0), (1, 1, 1e-6, 1, 1), (1e3, 1, 1e-3, 1e3, 1e3), (1, 1, 1, 1e3, 1)]
    moving = [np.stack([x, v * np.array(factors)[:, None]]) for factors in speeds]
    return np.stack([*stretched, np.stack([x + 30.0 * last, v]), *moving])


def _drawn(problem: Problem, random: np.random.Generator, alike: bool) -> np.ndarray:
    """A state with springs of other lengths, perhaps stretched alike, and other speeds."""
    ratios = np.exp(random.uniform(np.log(0.02), np.log(100.0), NODES - 1))
    if alike:
        ratios[:] = ratios[0]
    return _scaled(problem, ratios, np.exp(random.uniform(np.log(1e-4), np.log(100.0), NODES)))


def _at_rest_lengths(problem: Problem, random: np.random.Generator) -> np.ndarray:
    """A state in which no spring is stretched by more than a small part of its length."""
    size = np.exp(random.uniform(np.log(1e-4), np.log(0.1)))
    length = np.linalg.norm(np.diff(problem.y0[0], axis=0), axis=1)
    ratios = problem.args.rest_length / length * (1.0 + size * random.normal(size=NODES - 1))
    return _scaled(problem, ratios, np.zeros(NODES))


def _scaled(problem: Problem, ratios: np.ndarray, speeds: np.ndarray) -> np.ndarray:
    x, v = problem.y0
    along = np.cumsum(np.diff(x, axis=0) * ratios[:, None], axis=0)
    return np.stack([np.vstack([x[:1], x[:1] + along]), v * speeds[:, None]])


def _other_units(problem: Problem) -> Iterator[Case]:
    """The rope's first state in units that differ more and more from the usual ones, and others."""
    random = np.random.default_rng(2)

    def late() -> float:
        return random.choice([-1.0, 1.0]) * 2.0 ** random.integers(_LATE)

    for powers in _POWERS:
        yield Case(problem, problem.y0[None], Units(*np.exp2(powers)), later=late())
    for _ in range(_DRAWN_UNITS):
        speed, length, mass = (random.integers(*each) for each in _AT_ONCE)
        away = random.choice([-1.0, 1.0], DIM) * 2.0 ** random.integers(_AWAY)
        units = Units(*np.exp2((length, mass, length - speed)))
        yield Case(problem, problem.y0[None], units, away, late())


def _of_nodes(nodes: int, told: Callable[[Problem], Problem]) -> Case:
    """A random rope of so many nodes, of which every tenth is pinned or so, and a state of it."""
    random = np.random.default_rng(nodes)
    dim = 2 if nodes == _IN_A_PLANE else DIM
    free = np.where(random.random(nodes) < 0.1, 0.0, 1.0)
    free[random.integers(nodes)] = 1.0
    rest_length = random.uniform(0.5, 1.2, nodes - 1)
    # It goes to and fro, so that no position is a large number.
    along = np.ones(dim) + 0.5 * random.normal(size=(nodes - 1, dim))
    along *= (-1.0) ** np.arange(nodes - 1)[:, None]
    lengths = rest_length * random.uniform(0.7, 1.5, nodes - 1)
    along *= (lengths / np.linalg.norm(along, axis=1))[:, None]
    x = np.pad(np.cumsum(along, axis=0), ((1, 0), (0, 0)))
    y0 = np.stack([x, random.normal(size=x.shape) * free[:, None]])
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
    return Case(told(generic().changed(y0=y0, args=args, name=name)), y0[None])
