"""Thresholds with a unit: a rope in units a million times as large moves in the same way.

A speed below which a node is put to rest, a step size from which on another formula holds, a limit
on forces, a floor far below: each is a number with a unit, and in other units that number means
something else. Most right steps do the same in all units. One that divides dt into parts, or adapts
them to a tolerance, does not; it is held against the exact motion.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator

import numpy as np

from ropeode.checking.check_context import Examination
from ropeode.checking.check_ropes import DIM, Units, generic
from ropeode.checking.checks.local_errors import exact_states, why_unknown
from ropeode.checking.report import Finding
from ropeode.checking.time_limit import within
from ropeode.errors import UserCodeError
from ropeode.precision import in_float64
from ropeode.problems import Problem

_STEPS = 2
# In the usual unit of time. With other units of time and these lengths of frames there is a step
# size in each interval of a third.
_FRAMES = (0.5, 0.40625, 0.3125)
# Powers of two, in which the right result is the same to the last digit.
# The shortest steps come first, which nobody divides into parts.
_FAST = [2.0**-power for power in range(24, 0, -1)]
_SLOW = [2.0**power for power in range(1, 25)]
_HEAVY = [2.0**power for power in range(-30, 31, 5) if power]
_SMALL = 2.0**-8
# How many units of everything at once are drawn; how late a run begins, in units of time, and how
# far away it is then, in units of length: powers of two.
_DRAWN, _LATE, _AWAY = 48, 20, 10
# Of two: from less to more, of the units of speed, length and mass.
_POWERS = (20, 20), (6, 20), (30, 30)
# What a solver that iterates up to an absolute tolerance may leave, as a part of the rope's size.
# In units in which lengths or speeds are small numbers that is more, and rounding makes more of a
# derivative by finite differences where they are large numbers; but never as much as all.
_TOLERANCE, _MOST, _LARGE = 1e-5, 0.05, 2.0**10
# The processor time of a run. A step that iterates to a tolerance which rounding cannot reach,
# where numbers are large, does not return.
_SECONDS = 2.0
# After so many of these nothing more is tried.
_MOST_UNKNOWN = 3
# A run that differs may be more exact: then its error is at most this part of that in the usual
# units. If not, it is made with so many times as many steps, too. The error may then be so many
# times as large as in the usual units, or must fall with the order of the method less a margin.
_SMALLER, _FINER, _LARGER, _MARGIN = 0.75, (8, 32), 2.0, 0.5


def _ladder() -> Iterator[tuple[Units, np.ndarray]]:
    """Units, in which numbers differ more and more from the usual ones, and a place."""
    for units in _one_by_one():
        yield units, np.zeros(DIM)
    # All at once: a threshold may be one of two numbers.
    random = np.random.default_rng(2)
    for _ in range(_DRAWN):
        speed, length, mass = (random.integers(-low, high) for low, high in _POWERS)
        away = random.choice([-1.0, 1.0], DIM) * 2.0 ** random.integers(_AWAY)
        yield Units(*2.0 ** np.array([length, mass, length - speed])), away


def _one_by_one() -> Iterator[Units]:
    # Short steps at high speeds.
    yield from (Units(time=time) for time in _FAST)
    # Long steps at low speeds. Masses grow too, so that forces are not that small.
    yield from (Units(mass=time, time=time) for time in _SLOW)
    # Large ropes and long steps at the usual speeds.
    yield from (Units(length=time, time=time) for time in _SLOW)
    # Large and small forces.
    yield from (Units(mass=mass) for mass in _HEAVY)
    yield Units(length=_SMALL)


def scales(examination: Examination) -> Finding:
    """A rope in very large or small units of length, mass or time moves in the same way."""
    problem = examination.told(generic())
    if not examination.stepper.equal_frames:
        problem = problem.changed(ts=np.concatenate([[0.0], np.cumsum(_FRAMES)]))
    # Before and after the time 0.
    problem = problem.changed(ts=problem.ts - problem.ts[1])
    own = examination.run(problem, _STEPS)
    size = np.max(np.abs(own), axis=(0, 2, 3))[:, None, None]
    random = np.random.default_rng(3)

    def distance(states: np.ndarray, others: np.ndarray) -> float:
        return float(np.max(np.abs(states - others) / size))

    # Errors of runs with short steps that are right.
    right: list[float] = []

    @functools.cache
    def usual() -> tuple[np.ndarray, float, float]:
        """The exact motion, the error of the longest steps, and the order of the method."""
        exact = exact_states(problem)
        runs = own, *(examination.run(problem, _STEPS * n) for n in _FINER)
        errors = [distance(states, exact) for states in runs]
        # Not those of the shortest steps: they may be so short that another formula holds.
        right.append(min(errors))
        powers = map(_power, errors, errors[1:], (_FINER[0], _FINER[1] / _FINER[0]))
        return exact, errors[0], max(examination.expected(problem) or 0.0, *powers)

    def is_as_exact(states: np.ndarray, units: Units, away: np.ndarray, later: float) -> bool:
        """Whether a run in other units, or short steps there, are as exact as in the usual ones."""
        exact, longest, order = usual()
        if distance(states, exact) <= _SMALLER * longest:
            return True
        # Steps become shorter in two ways, so that no number leaves its threshold in both: dt does,
        # or dt and all speeds stay and the rope grows.
        for grows in (0, 1):
            errors = []
            for n in _FINER:
                part = units._replace(length=units.length * n**grows, time=units.time * n**grows)
                other = _in_units(problem, part, away, later)
                finer = examination.run(other, _STEPS * n) / part.state - away
                errors.append(distance(finer, exact))
            if errors[-1] <= _LARGER * max(right) + _allowed(part, away):
                continue
            coarse, fine = errors
            if not _power(coarse, fine, _FINER[1] / _FINER[0]) >= order - _MARGIN:
                return False
            right.append(errors[-1])
        return True

    worst, done, more_exact, unknown = 0.0, 0, 0, []
    for units, place in _ladder():
        away = np.stack([place, 0.0 * place])[:, None]
        later = random.choice([-1.0, 1.0]) * 2.0 ** random.integers(_LATE)
        other = _in_units(problem, units, away, later)

        def work(
            units: Units = units, away: np.ndarray = away, later: float = later, other=other
        ) -> tuple[float, bool]:
            states = examination.run(other, _STEPS) / units.state - away
            off = distance(states, own)
            same = off <= _allowed(units, away)
            return off, same or is_as_exact(states, units, away, later)

        try:
            off, fine = within(_SECONDS, "a run in other units", in_float64(work))
        except UserCodeError as error:
            unknown.append(f"not known {_where(other)}: {why_unknown(error)}")
            if len(unknown) > _MOST_UNKNOWN:
                break
            continue
        if not fine:
            line = (
                f"in other units a rope moves differently, by {off:.1e} of its size, and its short "
                f"steps err more, {_where(other)}; is there a threshold or a limit, a constant "
                "with a unit?"
            )
            return Finding("scales", "fail", line, {"difference": off, "units": units._asdict()})
        if off <= _allowed(units, away):
            worst, done = max(worst, off), done + 1
        else:
            more_exact += 1
    if unknown:
        return Finding("scales", "note", unknown[0])
    line = (
        f"in {done} units, with step sizes from 1e-8 to 1e6, speeds from 1e-7 to 1e7 and forces "
        f"from 1e-9 to 1e9, a rope moves in the same way, to {worst:.1e} of its size"
    )
    if more_exact:
        line += f"; in {more_exact} others it moves differently, and steps err no more"
    return Finding("scales", "pass", line, {"difference": worst})


def _in_units(problem: Problem, units: Units, away: np.ndarray, later: float) -> Problem:
    """A rope in other units, so far away and so much later in these."""
    other = units.of(problem.changed(y0=problem.y0 + away))
    return other.changed(ts=other.ts + later * units.time)


def _allowed(units: Units, away: np.ndarray) -> float:
    """What a run may differ by, as a part of the rope's size."""
    speed = units.length / units.time
    small, large = min(units.length, speed), max(units.length, speed)
    # A tolerance may be one for parts of the state.
    part = max(1.0, float(np.max(np.abs(away))))
    return min(max(part, 1.0 / small, large / _LARGE) * _TOLERANCE, _MOST)


def _power(coarse: float, fine: float, ratio: float) -> float:
    """Of the step size, with which an error falls; -inf where one is not a number, or 0."""
    if not (math.isfinite(coarse) and math.isfinite(fine)) or coarse == 0.0:
        return -math.inf
    return math.log(coarse / max(fine, 1e-300)) / math.log(ratio)


def _where(problem: Problem) -> str:
    dt = (problem.ts[1] - problem.ts[0]) / _STEPS
    x, v = (np.max(np.abs(half)) for half in problem.y0)
    force = np.max(problem.args.mass) * np.max(np.abs(problem.args.gravity))
    return (
        f"where dt is {dt:.0e}, lengths are about {x:.0e}, speeds {v:.0e}, forces {force:.0e} and "
        f"times {problem.ts[0]:.0e} to {problem.ts[-1]:.0e}"
    )
