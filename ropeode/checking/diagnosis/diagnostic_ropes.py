"""Ropes on which a single kind of mistake can show."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np

from ropeode.checking.check_ropes import CROOKED, MOVING, check_rope, hanging, undamped
from ropeode.problems.problem import Problem

# One value for all nodes or springs, so that a single number can be fitted. No two values, nor
# their products and quotients, are equal.
_UNIFORM: dict[str, Any] = {
    "mass": 1.3,
    "stiffness": 3.7,
    "rest_length": 0.8,
    "damping": 0.45,
    "gravity": (0.3, -0.8, 0.2),
    "pinned": (1,),
}


@functools.cache
def uniform_rope() -> Problem:
    """A rope whose parameters all show in its motion; they are fitted on it."""
    return check_rope("uniform", CROOKED, (0.0, 0.4, 0.8, 1.2), v0=MOVING, **_UNIFORM)


@functools.cache
def uniform_rope_with_other_start() -> Problem:
    """The same parameters with another initial state, over another span."""
    start = CROOKED[:, (1, 0, 2)] + np.outer(np.arange(5.0), (0.1, 0.0, -0.15))
    velocity = 0.7 * MOVING[::-1, (2, 0, 1)]
    return check_rope(
        "uniform, other start", start, (0.0, 0.35, 0.7, 1.05), v0=velocity, **_UNIFORM
    )


@functools.cache
def uniform_rope_with_other_parameters() -> Problem:
    """Other parameters, which separate mistakes that have the same effect on the first."""
    other: dict[str, Any] = {
        "mass": 0.6,
        "stiffness": 2.3,
        "rest_length": 1.4,
        "damping": 0.25,
        "gravity": (-0.5, -0.7, 0.4),
        "pinned": (1,),
    }
    return check_rope(
        "uniform, other parameters", 1.2 * CROOKED, (0.0, 0.3, 0.6, 0.9), v0=MOVING, **other
    )


@functools.cache
def weakly_damped() -> Problem:
    """The first rope at rest, damped so weakly that it moves even if damping acts at each step."""
    return check_rope(
        "weakly damped", CROOKED, (0.0, 0.4, 0.8, 1.2), **{**_UNIFORM, "damping": 0.02}
    )


@functools.cache
def driven_from_rest(start: str, damping: float = 0.0) -> Problem:
    """A rope in equilibrium, set in motion by a drive.

    Arguments:
        start: `soft`: the drive grows from zero, so that the initial acceleration is zero;
            `hard`: the drive begins at its largest.
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
def alternate_nodes_pinned() -> Problem:
    """The undamped rope with every other node pinned: no two moving nodes are neighbours."""
    rope = undamped()
    free = np.array([0.0, 1.0, 0.0, 1.0, 0.0])
    return rope.changed(
        y0=rope.y0 * np.stack([np.ones(5), free])[:, :, None],
        args=rope.args._replace(free=free),
        name="every other node pinned",
    )
