"""Symmetries: a rope that is moved, rotated or renumbered still moves in the same way."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
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
# Of starting times. Frames end at the same fractions of a time unit, exactly.
_LATER = (2.7182818, 16.0, -16.0, 1024.0, -1024.0, 2.0**20, -(2.0**20))
_FRAME = 0.5
# Periods of the drive by which single steps are moved: all up to the first number, and so many up
# to the second one; their length, and the processor time of all.
_NEAR, _FAR, _TIMES, _STEP, _SECONDS = 60, 5e5, 100, 0.05, 10.0
# What they may differ by, for each unit of time; a time in float32 makes three times as much.
_PER_TIME = 1e-9
# From such times on a step that asks for forces at t + c dt gets them at rounded times.
_LATE = 1e4


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


def _translated() -> Iterator[Pair]:
    yield _moved(generic(), np.stack([_SHIFT, 0.0 * _SHIFT])[None, :, None], "that is translated")


def _boosted() -> Iterator[Pair]:
    """A free rope in a uniformly moving frame of reference."""
    problem = convergence_problems()["free"]
    since = problem.ts - problem.ts[0]
    flown = np.stack([np.outer(since, _SHIFT), np.tile(_SHIFT, (len(since), 1))], axis=1)
    yield _moved(problem, flown[:, :, None], "in a uniformly moving frame of reference")


def _moved(problem: Problem, shift: np.ndarray, words: str) -> Pair:
    """By a shift of the states at the sample times, ``(times or 1, 2, 1, dim)``."""
    other = problem.changed(y0=problem.y0 + shift[0])
    return Pair(problem, other, lambda states: states - shift, words, _TOLERANCE_ELSEWHERE)


def _rotated() -> Iterator[Pair]:
    turn = _orthogonal()
    yield _turned(np.sign(np.linalg.det(turn)) * turn, "that is rotated together with gravity")


def _mirrored() -> Iterator[Pair]:
    normal = _orthogonal()[0]
    turn = np.eye(3) - 2.0 * np.outer(normal, normal)
    yield _turned(turn, "that is mirrored together with gravity")


def _orthogonal() -> np.ndarray:
    return np.linalg.qr(np.random.default_rng(7).normal(size=(3, 3)))[0]


def _turned(turn: np.ndarray, words: str) -> Pair:
    problem = generic()
    args = problem.args._replace(gravity=turn @ problem.args.gravity)
    other = problem.changed(y0=problem.y0 @ turn.T, args=args)
    return Pair(problem, other, lambda states: states @ turn, words)


def _renumbered() -> Iterator[Pair]:
    problem, words = generic(), "numbered from the other end"
    yield Pair(problem, renumbered(problem), lambda states: states[:, :, ::-1], words)


def _later() -> Iterator[Pair]:
    """A rope without a drive, at other starting times."""
    problem = generic().changed(ts=_FRAME * np.arange(len(generic().ts)))
    for later in _LATER:
        tolerance = _TOLERANCE if abs(later) < _LATE else _TOLERANCE_ELSEWHERE
        other, words = problem.changed(ts=problem.ts + later), f"that starts at t = {later:g}"
        yield Pair(problem, other, lambda states: states, words, tolerance)


def _in_other_units() -> Iterator[Pair]:
    # The textbook's lengths are integers, but not in another unit.
    for problem in (convergence_problems()["textbook"], generic()):
        other, words = in_other_units(problem), "in another unit of length"
        yield Pair(problem, other, lambda states: states / UNITS, words)


SYMMETRIES: dict[str, Callable[[], Iterator[Pair]]] = {
    "translation": _translated,
    "boost": _boosted,
    "rotation": _rotated,
    "mirror": _mirrored,
    "node-order": _renumbered,
    "time-shift": _later,
    "units": _in_other_units,
}
# Where to look for the cause.
_HINTS = {
    "node-order": "; are nodes updated one by one, from neighbours that have already moved?",
    "units": "; does the step contain a constant with a unit, or convert a length to an integer?",
}


def symmetry(examination: Examination, check: str) -> Finding:
    """Whether the ropes of each pair move in the same way; the first that do not are told."""
    for pair in SYMMETRIES[check]():
        finding = _compared(examination, check, pair)
        if finding.status == "fail":
            return finding
    if check == "time-shift":
        return _at_many_times(examination) or finding
    return finding


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


def _at_many_times(examination: Examination) -> Finding | None:
    """Single steps whole periods of the drive earlier and later; None where they are the same."""
    problem = examination.problems["driven"]
    random = np.random.default_rng(4)
    far = np.exp(random.uniform(np.log(_NEAR), np.log(_FAR), _TIMES))
    periods = np.concatenate([np.arange(_NEAR), np.round(far)])
    t = problem.ts[0] + 2.0 * np.pi / problem.args.frequency * np.concatenate([periods, -periods])
    y = np.repeat(problem.y0[None], len(t), axis=0)
    try:
        dt = np.full((len(t), 1), _STEP)
        samples = StepSamples(problem, examination.method)
        work = functools.partial(samples.after, t, y, dt, 1)
        states = within(_SECONDS, "steps at many times", work)[:, 0, 1]
    except UserCodeError as error:
        line = f"at other times: not known: {why_unknown(error)}"
        return Finding("time-shift", "note", line)
    off = np.max(np.abs(states - states[0]), axis=(1, 2, 3)) / problem.scale
    # What rounding makes of a derivative by time that is a difference over a short one.
    wrong = np.flatnonzero(~(off <= np.maximum(_TOLERANCE_ELSEWHERE, _PER_TIME * np.abs(t))))
    if not len(wrong):
        return None
    first = wrong[np.argmin(np.abs(t[wrong]))]
    line = f"a step at t = {t[first]:.6g} differs by {off[first]:.1e} from one at t = {t[0]:g}"
    return Finding(
        "time-shift", "fail", f"{line}, whole periods of the drive away", {"t": t[first]}
    )
