"""Known mistakes, as what they make of a number."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np


class Alike(NamedTuple):
    """Numbers of a rope that mistakes mix into others; not-a-number where they differ.

    Fields:
        mass: of each node.
        rest_length: of each spring.
    """

    mass: float
    rest_length: float


Value = Callable[[np.ndarray, Alike], np.ndarray]


class Law(NamedTuple):
    """What becomes of a number.

    Fields:
        words: for the author of the mistake.
        value: what is found, from what is claimed and other numbers of the rope.
    """

    words: str
    value: Value


def _times(factor: float) -> Value:
    return lambda claimed, rope: factor * claimed


def _times_mass(power: int) -> Value:
    return lambda claimed, rope: claimed * rope.mass**power


def _without(component: int) -> Value:
    return lambda claimed, rope: np.where(np.arange(len(claimed)) == component, 0.0, claimed)


def _doubled(what: str) -> tuple[Law, Law]:
    return Law(f"{what} counts twice", _times(2.0)), Law(f"{what} counts half", _times(0.5))


LAWS: dict[str, tuple[Law, ...]] = {
    "gravity": (
        Law("gravity is left out", _times(0.0)),
        Law("gravity has the wrong sign", _times(-1.0)),
        Law("gravity, an acceleration, is multiplied by the mass", _times_mass(1)),
        Law("gravity, an acceleration, is divided by the mass", _times_mass(-1)),
        Law("gravity is multiplied by the mass twice", _times_mass(2)),
        *(Law(f"gravity lacks its {axis} component", _without(k)) for k, axis in enumerate("xyz")),
        *_doubled("gravity"),
    ),
    "damping": (
        Law("the damping is left out", _times(0.0)),
        Law("the damping has the wrong sign", _times(-1.0)),
        Law("the damping force is not divided by the mass", _times_mass(1)),
        Law("the damping force is divided by the mass twice", _times_mass(-1)),
        *_doubled("the damping"),
    ),
    "stiffness": (
        Law("the springs are left out", _times(0.0)),
        Law("the springs push where they should pull", _times(-1.0)),
        Law("the springs' forces are not divided by the mass", _times_mass(1)),
        Law("the springs' forces are divided by the mass twice", _times_mass(-1)),
        Law("stiffnesses are divided by rest lengths", lambda k, rope: k / rope.rest_length),
        Law("stiffnesses are multiplied by rest lengths", lambda k, rope: k * rope.rest_length),
        *_doubled("each spring"),
    ),
    "mass": (
        Law("the mass is left out", lambda claimed, rope: np.ones_like(claimed)),
        Law("forces are divided by the mass twice", _times_mass(1)),
        *_doubled("the mass"),
    ),
    "rest_length": (
        Law("rest lengths are left out", _times(0.0)),
        Law("rest lengths are cut to whole numbers", lambda claimed, rope: np.trunc(claimed)),
        Law("rest lengths are rounded to whole numbers", lambda claimed, rope: np.round(claimed)),
        *_doubled("the rest length"),
    ),
    "velocity": (
        Law("the initial velocity is left out", _times(0.0)),
        Law("the initial velocity has the wrong sign", _times(-1.0)),
    ),
}


def holding(
    name: str, claimed: np.ndarray, found: np.ndarray, spread: np.ndarray, rope: Alike
) -> tuple[Law, ...]:
    """The laws of a parameter that give what was found, to its spread.

    Arguments:
        name: of the parameter.
        claimed: one number, or its components.
        found: likewise.
        spread: how far what was found may be off.
        rope: other numbers; no law holds with one that is not-a-number.
    """
    return tuple(
        law
        for law in LAWS[name]
        if np.all(np.abs(law.value(claimed, rope) - found) <= spread)
        and not np.all(np.abs(claimed - found) <= spread)
    )
