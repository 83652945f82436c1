"""Mistakes that people make, and what each does to a parameter."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np


class Uniform(NamedTuple):
    """Parameters that mistakes mix into others; not-a-number where nodes or springs differ.

    Fields:
        mass: of each node.
        rest_length: of each spring.
    """

    mass: float
    rest_length: float


Value = Callable[[np.ndarray, Uniform], np.ndarray]


class Mistake(NamedTuple):
    """A mistake that changes one parameter.

    Fields:
        words: describes it to its author.
        value: the wrong value, from the claimed one and the other parameters.
    """

    words: str
    value: Value


def _times(factor: float) -> Value:
    return lambda claimed, rope: factor * claimed


def _times_mass(power: int) -> Value:
    return lambda claimed, rope: claimed * rope.mass**power


def _without(component: int) -> Value:
    return lambda claimed, rope: np.where(np.arange(len(claimed)) == component, 0.0, claimed)


def _doubled(what: str) -> tuple[Mistake, Mistake]:
    return (
        Mistake(f"{what} is counted twice", _times(2.0)),
        Mistake(f"{what} is counted half", _times(0.5)),
    )


MISTAKES: dict[str, tuple[Mistake, ...]] = {
    "gravity": (
        Mistake("gravity is left out", _times(0.0)),
        Mistake("gravity has the wrong sign", _times(-1.0)),
        Mistake("gravity, an acceleration, is multiplied by the mass", _times_mass(1)),
        Mistake("gravity, an acceleration, is divided by the mass", _times_mass(-1)),
        Mistake("gravity is multiplied by the mass twice", _times_mass(2)),
        *(
            Mistake(f"the {axis} component of gravity is left out", _without(k))
            for k, axis in enumerate("xyz")
        ),
        *_doubled("gravity"),
    ),
    "damping": (
        Mistake("damping is left out", _times(0.0)),
        Mistake("damping has the wrong sign", _times(-1.0)),
        Mistake("the damping force is not divided by the mass", _times_mass(1)),
        Mistake("the damping force is divided by the mass twice", _times_mass(-1)),
        *_doubled("damping"),
    ),
    "stiffness": (
        Mistake("the springs are left out", _times(0.0)),
        Mistake("the springs push where they should pull", _times(-1.0)),
        Mistake("the spring forces are not divided by the mass", _times_mass(1)),
        Mistake("the spring forces are divided by the mass twice", _times_mass(-1)),
        Mistake(
            "the stiffness is divided by the rest length", lambda k, rope: k / rope.rest_length
        ),
        Mistake(
            "the stiffness is multiplied by the rest length",
            lambda k, rope: k * rope.rest_length,
        ),
        *_doubled("each spring"),
    ),
    "mass": (
        Mistake("the mass is left out", lambda claimed, rope: np.ones_like(claimed)),
        Mistake("forces are divided by the mass twice", _times_mass(1)),
        *_doubled("the mass"),
    ),
    "rest_length": (
        Mistake("rest lengths are left out", _times(0.0)),
        Mistake("rest lengths are truncated to integers", lambda claimed, rope: np.trunc(claimed)),
        Mistake("rest lengths are rounded to integers", lambda claimed, rope: np.round(claimed)),
        *_doubled("the rest length"),
    ),
    "velocity": (
        Mistake("the initial velocity is left out", _times(0.0)),
        Mistake("the initial velocity has the wrong sign", _times(-1.0)),
    ),
}
