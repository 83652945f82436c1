"""Ropes on which one cause of a mistake at a time can show."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np

from ropeode.checking.problems import check_rope, hanging, undamped
from ropeode.problems.problem import Problem

_START = np.array(
    [[0.1, 0.2, 0.0], [0.9, -0.1, 0.3], [1.7, 0.5, 0.1], [2.4, 0.2, -0.6], [3.1, -0.4, -0.2]]
)
_VELOCITY = np.array(
    [[0.3, -0.5, 0.2], [0.0, 0.0, 0.0], [-0.4, 0.3, 0.6], [0.2, 0.8, -0.3], [-0.6, 0.1, 0.5]]
)
# Nodes and springs are alike, so that one number stands for all, and no two numbers, nor their
# products and quotients, are the same.
_ALIKE: dict[str, Any] = {
    "mass": 1.3,
    "stiffness": 3.7,
    "rest_length": 0.8,
    "damping": 0.45,
    "gravity": (0.3, -0.8, 0.2),
    "pinned": (1,),
}


@functools.cache
def alike() -> Problem:
    """A rope whose numbers all show in its motion; they are fitted on it."""
    return check_rope("alike", _START, (0.0, 0.4, 0.8, 1.2), v0=_VELOCITY, **_ALIKE)


@functools.cache
def alike_again() -> Problem:
    """The same numbers from another initial state, for another span."""
    start = _START[:, (1, 0, 2)] + np.outer(np.arange(5.0), (0.1, 0.0, -0.15))
    velocity = 0.7 * _VELOCITY[::-1, (2, 0, 1)]
    return check_rope("alike, again", start, (0.0, 0.35, 0.7, 1.05), v0=velocity, **_ALIKE)


@functools.cache
def alike_otherwise() -> Problem:
    """Other numbers, which tell apart what makes the same of the first."""
    other: dict[str, Any] = {
        "mass": 0.6,
        "stiffness": 2.3,
        "rest_length": 1.4,
        "damping": 0.25,
        "gravity": (-0.5, -0.7, 0.4),
        "pinned": (1,),
    }
    return check_rope("alike, otherwise", 1.2 * _START, (0.0, 0.3, 0.6, 0.9), v0=_VELOCITY, **other)


@functools.cache
def hardly_damped() -> Problem:
    """The first rope at rest with a damping so small that it may act at each step."""
    return check_rope(
        "hardly damped", _START, (0.0, 0.4, 0.8, 1.2), **{**_ALIKE, "damping": HARDLY}
    )


# Coefficient of that damping.
HARDLY = 0.02


@functools.cache
def driven_from_rest(start: str, damping: float = 0.0) -> Problem:
    """A rope in equilibrium, set in motion by a drive.

    Arguments:
        start: `soft`: the drive grows from nothing, so that at first not even the
            acceleration differs from zero; `hard`: it is at its largest at first.
        damping: coefficient, of all nodes.
    """
    still, frequency = hanging(), 3.1
    begin = {"soft": 0.5 * np.pi / frequency, "hard": 0.0}[start]
    return check_rope(
        f"{start} start" + (", damped" if damping else ""),
        still.y0[0],
        begin + 0.5 * np.arange(4.0),
        mass=still.args.mass,
        stiffness=still.args.stiffness,
        rest_length=still.args.rest_length,
        gravity=still.args.gravity,
        damping=damping,
        drive=(0.9, 0.7, -1.1),
        frequency=frequency,
    )


@functools.cache
def apart() -> Problem:
    """The undamped rope with every other node pinned, so that no two that move are neighbours."""
    given = undamped()
    free = np.array([0.0, 1.0, 0.0, 1.0, 0.0])
    return given.changed(
        y0=given.y0 * np.stack([np.ones(5), free])[:, :, None],
        args=given.args._replace(free=free),
        name="every other node pinned",
    )


def renumbered(problem: Problem) -> Problem:
    """The same rope with its nodes counted from the other end.

    Arguments:
        problem: a check rope; its states are those of the new one with the nodes reversed.
    """
    args = problem.args
    names = ("mass", "stiffness", "rest_length", "free", "damping")
    other = args._replace(**{name: getattr(args, name)[::-1].copy() for name in names})
    return problem.changed(y0=problem.y0[:, ::-1].copy(), args=other)


def in_units_of_1024(problem: Problem) -> Problem:
    """The same rope with its lengths in a unit that is 1024 times as small.

    A power of two changes no digit of a binary number, be it of 24 or of 53 bits; all the
    states are 1024 times as large, to the last bit.

    Arguments:
        problem: a check rope.
    """
    args = problem.args
    scaled = {name: 1024.0 * getattr(args, name) for name in ("rest_length", "gravity", "drive")}
    return problem.changed(y0=1024.0 * problem.y0, args=args._replace(**scaled))
