"""What is moved, turned, mirrored, renumbered, begun later or measured otherwise moves the same."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ropeode.checking.check_context import Examination
from ropeode.checking.problems import UNITS, convergence_problems, generic, in_other_units
from ropeode.checking.report import Finding
from ropeode.problems.problem import Problem

_STEPS = 10
# Of the size of the rope: rounding stays three digits below, and what an unsymmetric formula
# changes several above.
_TOLERANCE = 1e-10
# So far that limits of a playing field show, and so near that rounding does not.
_SHIFT = np.array([310.0, -230.0, 170.0])
_LATER = 2.7182818


def translation(examination: Examination) -> Finding:
    """A rope elsewhere moves in the same way."""
    problem = generic()
    shift = np.stack([_SHIFT, 0.0 * _SHIFT])[:, None]
    return _compared(
        examination,
        "translation",
        problem.changed(y0=problem.y0 + shift),
        lambda states: states - shift,
        "moved elsewhere",
    )


def boost(examination: Examination) -> Finding:
    """A free rope that flies along moves in the same way, seen from beside it."""
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
        "that is free and flies along",
        problem=problem,
    )


def rotation(examination: Examination) -> Finding:
    """A rope that is turned, with gravity, moves in the same way."""
    turn = _orthogonal()
    if np.linalg.det(turn) < 0:
        turn = -turn
    return _transformed(examination, "rotation", turn, "turned in space, with gravity")


def mirror(examination: Examination) -> Finding:
    """A rope that is mirrored, with gravity, moves in the same way."""
    normal = _orthogonal()[0]
    return _transformed(
        examination, "mirror", np.eye(3) - 2.0 * np.outer(normal, normal), "mirrored, with gravity"
    )


def node_order(examination: Examination) -> Finding:
    """A rope whose nodes are numbered from its other end moves in the same way."""
    problem = generic()
    args = problem.args
    names = ("mass", "stiffness", "rest_length", "free", "damping")
    reversed_args = args._replace(**{name: getattr(args, name)[::-1].copy() for name in names})
    other = problem.changed(y0=problem.y0[:, ::-1].copy(), args=reversed_args)
    return _compared(
        examination,
        "node-order",
        other,
        lambda states: states[:, :, ::-1],
        "numbered from the other end",
        "; are nodes updated one by one, with what neighbours have moved to already?",
    )


def time_shift(examination: Examination) -> Finding:
    """A rope without a drive moves in the same way whenever it is let go."""
    problem = generic()
    later = problem.changed(ts=problem.ts + _LATER)
    return _compared(examination, "time-shift", later, lambda states: states, "begun later")


def units(examination: Examination) -> Finding:
    """A rope whose lengths are measured in another unit moves in the same way."""
    textbook = convergence_problems()["textbook"]
    # The textbook's lengths are whole numbers, and in another unit they are not.
    for problem in (textbook, generic()):
        found = _compared(
            examination,
            "units",
            in_other_units(problem),
            lambda states: states / UNITS,
            "measured in another unit of length",
            "; is there a constant in it that has a unit, or a length made a whole number?",
            problem,
        )
        if found.status == "fail":
            break
    return found


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
    """A run of a problem (by default the generic one) beside the same of a transformed one."""
    run, problem = examination.candidate.run, problem or generic()
    own, others = run(problem, _STEPS), back(run(other, _STEPS))
    apart = float(np.max(np.abs(own - others))) / problem.scale
    if not apart <= _TOLERANCE:
        line = f"the rope {words} moves otherwise, by {apart:.1e} of its size{hint}"
        return Finding(check, "fail", line, {"difference": apart})
    line = f"the rope {words} moves the same, to {apart:.1e} of its size"
    return Finding(check, "pass", line, {"difference": apart})
