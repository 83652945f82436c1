"""Symmetries: a rope that is moved, rotated or renumbered still moves in the same way."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ropeode.checking.check_context import Examination
from ropeode.checking.check_ropes import (
    UNITS,
    convergence_problems,
    generic,
    in_other_units,
    renumbered,
)
from ropeode.checking.checks.local_errors import why_unknown
from ropeode.checking.checks.vanishing import judged
from ropeode.checking.report import Finding
from ropeode.checking.time_limit import within
from ropeode.errors import UserCodeError
from ropeode.problems import Problem
from ropeode.theory import StepSamples

_STEPS = 10
# As a part of the rope's size: rounding is three digits smaller, and an asymmetric formula
# changes several digits more.
_TOLERANCE = 1e-10
# Far from the origin a position has two digits fewer, and a velocity that is a difference of
# positions over a short substep up to two more.
_TOLERANCE_ELSEWHERE = 1e-8
# Large enough to reveal limits on positions and speeds, too small for rounding to matter.
_SHIFT = np.array([310.0, -230.0, 170.0])
# Periods of the drive by which a few steps are moved: all up to the first number, and so many up to
# the second one; how many steps, and their length; the processor time of all.
_NEAR, _FAR, _TIMES, _FEW, _STEP, _SECONDS = 60, 5e5, 100, 2, 0.05, 10.0
# What they may differ by, for each unit of time; a time in float32 makes three times as much.
_PER_TIME = 1e-9


class Pair(NamedTuple):
    """Two ropes that move in the same way.

    Fields:
        rope: one of them.
        other: the other one.
        back: makes states of the first rope of those of the other.
        words: what sets the other one apart.
        tolerance: what rounding may leave, as a part of the rope's size.
    """

    rope: Problem
    other: Problem
    back: Callable[[np.ndarray], np.ndarray]
    words: str
    tolerance: float = _TOLERANCE


def _moved(problem: Problem, velocity: np.ndarray, words: str) -> Pair:
    """By a shift, and from then on at a constant velocity."""
    since = (problem.ts - problem.ts[0])[:, None]
    places, speeds = _SHIFT + since * velocity, np.tile(velocity, (len(since), 1))
    shift = np.stack([places, speeds], axis=1)[:, :, None]
    other = problem.changed(y0=problem.y0 + shift[0])
    return Pair(problem, other, lambda states: states - shift, words, _TOLERANCE_ELSEWHERE)


def _turned(turn: np.ndarray, words: str) -> Pair:
    """By an orthogonal matrix."""
    problem = generic()
    args = problem.args._replace(gravity=turn @ problem.args.gravity)
    other = problem.changed(y0=problem.y0 @ turn.T, args=args)
    return Pair(problem, other, lambda states: states @ turn, f"that is {words} with gravity")


def _orthogonal() -> np.ndarray:
    turn = np.linalg.qr(np.random.default_rng(7).normal(size=(3, 3)))[0]
    return np.sign(np.linalg.det(turn)) * turn


def _in_other_units(problem: Problem) -> Pair:
    other, words = in_other_units(problem), "in another unit of length"
    return Pair(problem, other, lambda states: states / UNITS, words)


def _renumbered(problem: Problem) -> Pair:
    other, words = renumbered(problem), "numbered from the other end"
    return Pair(problem, other, lambda states: states[:, :, ::-1], words)


SYMMETRIES: dict[str, Callable[[], list[Pair]]] = {
    "translation": lambda: [_moved(generic(), 0.0 * _SHIFT, "that is translated")],
    "boost": lambda: [
        _moved(convergence_problems()["free"], _SHIFT, "in a uniformly moving frame of reference")
    ],
    "rotation": lambda: [_turned(_orthogonal(), "rotated together")],
    "mirror": lambda: [_turned(_orthogonal() * [-1.0, 1.0, 1.0], "mirrored together")],
    "node-order": lambda: [_renumbered(generic())],
    # The textbook's lengths are integers, but not in another unit.
    "units": lambda: [
        _in_other_units(convergence_problems()["textbook"]),
        _in_other_units(generic()),
    ],
}
# Where to look for the cause.
_HINTS = {
    "node-order": "; are nodes updated one by one, from neighbours that have already moved?",
    "units": "; does the step contain a constant with a unit, or convert a length to an integer?",
}


def symmetry(examination: Examination, check: str) -> Finding:
    """Whether the ropes of each pair move in the same way; the first that do not are told."""
    findings = [_compared(examination, check, pair) for pair in SYMMETRIES[check]()]
    return next((each for each in findings if each.status == "fail"), findings[-1])


def _compared(examination: Examination, check: str, pair: Pair) -> Finding:
    def difference(steps: int) -> float:
        """The largest, as a part of the rope's size."""
        others = pair.back(examination.run(pair.other, steps))
        return float(np.max(np.abs(examination.run(pair.rope, steps) - others))) / pair.rope.scale

    words = f"a rope {pair.words} moves"
    return judged(
        check,
        examination,
        pair.rope,
        difference,
        steps=_STEPS,
        allowed=pair.tolerance,
        good=f"{words} in the same way, to {{}} of its size",
        bad=f"{words} differently, by {{}} of its size",
        evidence="difference",
        hint=_HINTS.get(check, ""),
        sweeps=check == "node-order",
    )


def time_shift(examination: Examination) -> Finding:
    """Whether steps are the same whole periods of the drive earlier and later."""
    problem = examination.problems["driven"]
    random = np.random.default_rng(4)
    far = np.exp(random.uniform(np.log(_NEAR), np.log(_FAR), _TIMES))
    periods = np.concatenate([np.arange(_NEAR), np.round(far)])
    t = problem.ts[0] + 2.0 * np.pi / problem.args.frequency * np.concatenate([periods, -periods])
    y = np.repeat(problem.y0[None], len(t), axis=0)
    try:
        dt = np.full((len(t), 1), _STEP)
        samples = StepSamples(problem, examination.method)
        work = functools.partial(samples.after, t, y, dt, _FEW)
        states = within(_SECONDS, "steps at many times", work)[:, 0, _FEW]
    except UserCodeError as error:
        line = f"at other times: not known: {why_unknown(error)}"
        return Finding("time-shift", "note", line)
    off = np.max(np.abs(states - states[0]), axis=(1, 2, 3)) / problem.scale
    # What rounding makes of a derivative by time that is a difference over a short one.
    wrong = np.flatnonzero(~(off <= np.maximum(_TOLERANCE_ELSEWHERE, _PER_TIME * np.abs(t))))
    if not len(wrong):
        line = f"steps at {len(t)} times are the same, to {np.max(off):.1e} of the rope's size"
        return Finding("time-shift", "pass", line, {"difference": float(np.max(off))})
    first = wrong[np.argmin(np.abs(t[wrong]))]
    line = (
        f"a step at t = {t[first]:.6g} differs by {off[first]:.1e} from one at t = {t[0]:g}, whole "
        "periods of the drive away"
    )
    return Finding("time-shift", "fail", line, {"t": t[first]})
