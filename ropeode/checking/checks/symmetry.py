"""Symmetries: a rope that is moved, rotated or renumbered still moves in the same way."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import numpy as np

from ropeode.checking.check_context import Examination
from ropeode.checking.check_ropes import (
    UNITS,
    convergence_problems,
    generic,
    in_other_units,
    renumbered,
)
from ropeode.checking.checks.local_errors import single_steps, why_unknown
from ropeode.checking.checks.vanishing import (
    POWER_TOLERANCE,
    STEPS,
    cut_off,
    falling_power,
    is_harmless,
    is_small,
)
from ropeode.checking.report import Finding
from ropeode.checking.time_limit import within
from ropeode.errors import UserCodeError
from ropeode.problems import Problem
from ropeode.simulation import step_size

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


def translation(examination: Examination) -> Finding:
    """A translated rope moves in the same way."""
    shift = np.stack([_SHIFT, 0.0 * _SHIFT])[None, :, None]
    return _moved(examination, "translation", generic(), shift, "that is translated")


def boost(examination: Examination) -> Finding:
    """A free rope in a uniformly moving frame of reference moves in the same way."""
    problem = convergence_problems()["free"]
    since = problem.ts - problem.ts[0]
    flown = np.stack([np.outer(since, _SHIFT), np.tile(_SHIFT, (len(since), 1))], axis=1)[
        :, :, None
    ]
    words = "in a uniformly moving frame of reference"
    return _moved(examination, "boost", problem, flown, words)


def rotation(examination: Examination) -> Finding:
    """A rope that is rotated together with gravity moves in the same way."""
    turn = _orthogonal()
    if np.linalg.det(turn) < 0:
        turn = -turn
    return _transformed(examination, "rotation", turn, "that is rotated together with gravity")


def mirror(examination: Examination) -> Finding:
    """A rope that is mirrored together with gravity moves in the same way."""
    normal = _orthogonal()[0]
    return _transformed(
        examination,
        "mirror",
        np.eye(3) - 2.0 * np.outer(normal, normal),
        "that is mirrored together with gravity",
    )


def node_order(examination: Examination) -> Finding:
    """A rope whose nodes are numbered from the other end moves in the same way.

    A method that sweeps over nodes or springs (Gauss and Seidel's iteration, a splitting) may
    depend on their order, as long as the difference vanishes like its error or is small beside
    that. A method that is claimed by name treats all nodes alike.
    """
    problem = generic()

    @functools.cache
    def difference(steps: int) -> float:
        others = examination.run(renumbered(problem), steps)[:, :, ::-1]
        return _apart(problem, examination.run(problem, steps), others)

    hint = "; are nodes updated one by one, from neighbours that have already moved?"
    words = "numbered from the other end"
    finding = _finding(examination, problem, "node-order", difference, words, hint)
    if finding.status == "pass" or not examination.may_sweep:
        return finding
    power, finest = finding.evidence["power"], STEPS[-1]
    line = f"a rope {words} moves differently, by {difference(finest):.1e} of its size"
    line += f" at dt = {step_size(problem, finest):.3g}"
    if power >= (examination.expected(problem) or 1) - POWER_TOLERANCE:
        line += f", and by dt^{power:.1f} less at smaller dt: it sweeps over nodes or springs"
        return Finding("node-order", "pass", line, finding.evidence)
    return finding


def time_shift(examination: Examination) -> Finding:
    """A rope without a drive moves in the same way at any starting time."""
    problem = generic().changed(ts=_FRAME * np.arange(len(generic().ts)))
    for later in _LATER:
        words = f"that starts at t = {later:g}"
        shifted = problem.changed(ts=problem.ts + later)
        finding = _compared(
            examination,
            "time-shift",
            shifted,
            lambda states: states,
            words,
            problem=problem,
            tolerance=_TOLERANCE if abs(later) < _LATE else _TOLERANCE_ELSEWHERE,
        )
        if finding.status == "fail":
            return finding
    return _at_many_times(examination) or finding


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
        work = functools.partial(single_steps, problem, examination.method, t, y, dt)
        states = within(_SECONDS, "steps at many times", work)[:, 0]
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


def units(examination: Examination) -> Finding:
    """A rope in another unit of length moves in the same way."""
    textbook = convergence_problems()["textbook"]
    # The textbook's lengths are integers, but not in another unit.
    for problem in (textbook, generic()):
        finding = _compared(
            examination,
            "units",
            in_other_units(problem),
            lambda states: states / UNITS,
            "in another unit of length",
            "; does the step contain a constant with a unit, or convert a length to an integer?",
            problem,
        )
        if finding.status == "fail":
            break
    return finding


def _orthogonal() -> np.ndarray:
    return np.linalg.qr(np.random.default_rng(7).normal(size=(3, 3)))[0]


def _moved(
    examination: Examination, check: str, problem: Problem, shift: np.ndarray, words: str
) -> Finding:
    """Compare a run with one of the same rope elsewhere.

    Arguments:
        examination: of the stepper.
        check: its name.
        problem: the rope where it is.
        shift: of the states at the sample times, ``(times or 1, 2, 1, dim)``.
        words: for the finding.
    """
    other = problem.changed(y0=problem.y0 + shift[0])

    def difference(steps: int) -> float:
        moved = examination.run(other, steps) - shift
        return _apart(problem, examination.run(problem, steps), moved)

    return _finding(examination, problem, check, difference, words, tolerance=_TOLERANCE_ELSEWHERE)


def _transformed(examination: Examination, check: str, turn: np.ndarray, words: str) -> Finding:
    problem = generic()
    other = problem.changed(
        y0=problem.y0 @ turn.T,
        args=problem.args._replace(gravity=turn @ problem.args.gravity),
    )
    return _compared(examination, check, other, lambda states: states @ turn, words)


def _compared(
    examination: Examination,
    check: str,
    other: Problem,
    back: Callable[[np.ndarray], np.ndarray],
    words: str,
    hint: str = "",
    problem: Problem | None = None,
    tolerance: float = _TOLERANCE,
) -> Finding:
    """Compare a run of a problem (by default the generic one) with one of a transformed problem."""
    own = problem or generic()

    def difference(steps: int) -> float:
        return _apart(own, examination.run(own, steps), back(examination.run(other, steps)))

    return _finding(examination, own, check, difference, words, hint, tolerance)


def _apart(problem: Problem, a: np.ndarray, b: np.ndarray) -> float:
    """The largest difference between two runs, as a part of the rope's size."""
    return float(np.max(np.abs(a - b))) / problem.scale


def _finding(
    examination: Examination,
    problem: Problem,
    check: str,
    difference: Callable[[int], float],
    words: str,
    hint: str = "",
    tolerance: float = _TOLERANCE,
) -> Finding:
    """Whether two ropes move in the same way.

    What an iteration or steps inside the step leave that end at a tolerance need not: the tolerance
    has a unit, or is a part of a number that another motion adds to. That is no fault where it is
    small beside the error of the step.

    Arguments:
        examination: of the stepper.
        problem: one of the ropes.
        check: its name.
        difference: between the two at a number of steps per frame.
        words: what sets the other one apart.
        hint: where to look for the cause.
        tolerance: what rounding may leave, as a part of the rope's size.
    """
    found = difference(_STEPS)
    evidence: dict[str, Any] = {"difference": found}
    if found <= tolerance:
        line = f"a rope {words} moves in the same way, to {found:.1e} of its size"
        return Finding(check, "pass", line, evidence)
    line = f"a rope {words} moves differently, by {found:.1e} of its size"
    power = evidence["power"] = falling_power(difference)
    at = f" at dt = {step_size(problem, _STEPS):.3g}"
    if is_harmless(power, examination, problem):
        return Finding(check, "pass", f"{line}{at}, and by {cut_off(power)}", evidence)
    if is_small(difference, examination, problem):
        line += f"{at}, which is small beside the error of the step, as where a tolerance ends it"
        return Finding(check, "pass", line, evidence)
    return Finding(check, "fail", line + hint, evidence)
