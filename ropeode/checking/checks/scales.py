"""Thresholds with a unit: a rope in units a million times as large moves in the same way.

A speed below which a node is put to rest, a step size from which on another formula holds, a limit
on forces, a floor far below: each is a number with a unit, and in other units that number means
something else. No truth is needed to see it, and numbers of every size are tried.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ropeode.checking.check_context import Examination
from ropeode.checking.check_ropes import Units, generic
from ropeode.checking.report import Finding
from ropeode.checking.time_limit import within
from ropeode.errors import UserCodeError
from ropeode.precision import in_float64
from ropeode.problems.problem import Problem

_STEPS = 2
# Powers of two, in which the right result is the same to the last digit.
_FAST = [2.0**-power for power in range(4, 28, 4)]
_SLOW = [2.0**power for power in range(4, 28, 4)]
_HEAVY = [2.0**power for power in (-30, -20, -10, 10, 20, 30)]
_SMALL = 2.0**-8
# What a solver that iterates up to an absolute tolerance may leave, as a part of the rope's size.
# In units in which lengths or speeds are small numbers that is more, and rounding makes more of a
# derivative by finite differences where they are large numbers; but never as much as all.
_TOLERANCE, _MOST, _LARGE = 1e-5, 0.05, 2.0**10
# The processor time of a run. A step that iterates to a tolerance which rounding cannot reach,
# where numbers are large, does not return.
_SECONDS = 2.0


def _ladder() -> Iterator[Units]:
    """Units, in which numbers differ more and more from those that they are in the usual ones."""
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
    problem = generic()
    # Before and after the time 0.
    problem = problem.changed(ts=problem.ts - problem.ts[1])
    size = np.max(np.abs(problem.y0), axis=(1, 2), keepdims=True)
    own = examination.run(problem, _STEPS)
    worst = 0.0
    for units in _ladder():
        other, where = units.of(problem), _where(units.of(problem))
        try:
            work = in_float64(lambda other=other: examination.run(other, _STEPS))
            states = within(_SECONDS, "a run in other units", work) / units.state
        except UserCodeError as error:
            line = f"not known {where}: {error.problems[0].split('; allowed')[0]}"
            return Finding("scales", "note", line)
        off = float(np.max(np.abs(states - own) / size))
        speed = units.length / units.time
        small, large = min(units.length, speed), max(units.length, speed)
        allowed = max(1.0, 1.0 / small, large / _LARGE) * _TOLERANCE
        if not off <= min(allowed, _MOST):
            line = (
                f"in other units a rope moves differently, by {off:.1e} of its size, {where}; is "
                "there a threshold or a limit, a constant with a unit?"
            )
            return Finding("scales", "fail", line, {"difference": off, "units": units._asdict()})
        worst = max(worst, off)
    line = (
        "with step sizes from 1e-8 to 1e6, speeds from 1e-7 to 1e7 and forces from 1e-9 to 1e9 a "
        f"rope moves in the same way, to {worst:.1e} of its size"
    )
    return Finding("scales", "pass", line, {"difference": worst})


def _where(problem: Problem) -> str:
    dt = (problem.ts[1] - problem.ts[0]) / _STEPS
    x, v = (np.max(np.abs(half)) for half in problem.y0)
    force = np.max(problem.args.mass) * np.max(np.abs(problem.args.gravity))
    return (
        f"where dt is {dt:.0e}, lengths are about {x:.0e}, speeds {v:.0e}, forces {force:.0e} and "
        f"times {problem.ts[0]:.0e} to {problem.ts[-1]:.0e}"
    )
