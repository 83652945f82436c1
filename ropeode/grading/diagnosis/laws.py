"""Known mistakes, as what they make of a number."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np


class Law(NamedTuple):
    """What becomes of a number.

    Fields:
        words: for the author of the mistake.
        value: what is found, from what is claimed and the mass of a node.
    """

    words: str
    value: Callable[[np.ndarray, float], np.ndarray]


def _times(factor: float) -> Callable[[np.ndarray, float], np.ndarray]:
    return lambda claimed, mass: factor * claimed


def _times_mass(power: int) -> Callable[[np.ndarray, float], np.ndarray]:
    return lambda claimed, mass: claimed * mass**power


def _without(component: int) -> Callable[[np.ndarray, float], np.ndarray]:
    return lambda claimed, mass: np.where(np.arange(len(claimed)) == component, 0.0, claimed)


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
        *_doubled("each spring"),
    ),
    "mass": (
        Law("the mass is left out", lambda claimed, mass: np.ones_like(claimed)),
        Law("forces are divided by the mass twice", _times_mass(1)),
        *_doubled("the mass"),
    ),
    "rest_length": (
        Law("rest lengths are left out", _times(0.0)),
        Law("rest lengths are cut to whole numbers", lambda claimed, mass: np.trunc(claimed)),
        Law("rest lengths are rounded to whole numbers", lambda claimed, mass: np.round(claimed)),
        *_doubled("the rest length"),
    ),
    "velocity": (
        Law("the initial velocity is left out", _times(0.0)),
        Law("the initial velocity has the wrong sign", _times(-1.0)),
    ),
}


def holding(
    name: str, claimed: np.ndarray, found: np.ndarray, spread: np.ndarray, mass: float
) -> tuple[Law, ...]:
    """The laws of a parameter that give what was found, to its spread.

    Arguments:
        name: of the parameter.
        claimed: one number, or its components.
        found: likewise.
        spread: how far what was found may be off.
        mass: of a node; not-a-number where nodes differ, and then no law with it holds.
    """
    return tuple(
        law
        for law in LAWS[name]
        if np.all(np.abs(law.value(claimed, mass) - found) <= spread)
        and not np.all(np.abs(claimed - found) <= spread)
    )
