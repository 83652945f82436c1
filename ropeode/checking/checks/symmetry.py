"""Symmetries: a rope that is moved, rotated or renumbered still moves in the same way."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ropeode.checking.check_context import Examination
from ropeode.checking.check_ropes import (
    UNITS,
    convergence_problems,
    generic,
    in_other_units,
    renumbered,
)
from ropeode.checking.report import Finding, passed_if
from ropeode.problems.problem import Problem

_STEPS = 10
# As a part of the rope's size: rounding is three digits smaller, and an asymmetric formula
# changes several digits more.
_TOLERANCE = 1e-10
# Large enough to reveal limits on positions and speeds, too small for rounding to matter.
_SHIFT = np.array([310.0, -230.0, 170.0])
# Of starting times. Frames end at the same fractions of a time unit, exactly.
_LATER = (2.7182818, 16.0, -16.0, 1024.0, -1024.0, 2.0**20, -(2.0**20))
_FRAME = 0.5


def translation(examination: Examination) -> Finding:
    """A translated rope moves in the same way."""
    problem = generic()
    shift = np.stack([_SHIFT, 0.0 * _SHIFT])[:, None]
    return _compared(
        examination,
        "translation",
        problem.changed(y0=problem.y0 + shift),
        lambda states: states - shift,
        "that is translated",
    )


def boost(examination: Examination) -> Finding:
    """A free rope in a uniformly moving frame of reference moves in the same way."""
    problem = convergence_problems()["free"]
    since = problem.ts - problem.ts[0]
    flown = np.stack([np.outer(since, _SHIFT), np.tile(_SHIFT, (len(since), 1))], axis=1)[
        :, :, None
    ]
    return _compared(
        examination,
        "boost",
        problem.changed(y0=problem.y0 + flown[0]),
        lambda states: states - flown,
        "in a uniformly moving frame of reference",
        problem=problem,
    )


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
    """A rope whose nodes are numbered from the other end moves in the same way."""
    return _compared(
        examination,
        "node-order",
        renumbered(generic()),
        lambda states: states[:, :, ::-1],
        "numbered from the other end",
        "; are nodes updated one by one, from neighbours that have already moved?",
    )


def time_shift(examination: Examination) -> Finding:
    """A rope without a drive moves in the same way at any starting time."""
    problem = generic().changed(ts=_FRAME * np.arange(len(generic().ts)))
    for later in _LATER:
        words = f"that starts at t = {later:g}"
        shifted = problem.changed(ts=problem.ts + later)
        finding = _compared(
            examination, "time-shift", shifted, lambda states: states, words, problem=problem
        )
        if finding.status == "fail":
            break
    return finding


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
) -> Finding:
    """Compare a run of a problem (by default the generic one) with one of a transformed problem."""
    run, problem = examination.run, problem or generic()
    own, others = run(problem, _STEPS), back(run(other, _STEPS))
    difference = float(np.max(np.abs(own - others))) / problem.scale
    return passed_if(
        difference <= _TOLERANCE,
        check,
        f"a rope {words} moves in the same way, to {difference:.1e} of its size",
        f"a rope {words} moves differently, by {difference:.1e} of its size{hint}",
        difference=difference,
    )
