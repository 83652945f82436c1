"""Mistakes that people make with a rope's terms, what each makes of them, and what is right."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ropeode.theory.rope_terms import TermPlace


class Mistake(NamedTuple):
    """What a mistake makes of a term.

    Fields:
        words: what follows the subject, such as "the damping".
        factor: by which it multiplies the term, at a place.
    """

    words: str
    factor: Callable[[TermPlace], float]


# What the terms are called, and how they are written; d leads to a spring's other end. A mass
# divides all forces.
SUBJECTS = {
    "gravity": "gravity",
    "drive": "the driving force",
    "damping": "the damping",
    "spring": "the spring force",
    "rest": "the rest length",
    "mass": "the mass",
    "velocity": "the initial velocity",
}
_SPRING = "a_spring = stiffness * (length - rest_length) * d / length / mass"
_ALL = "a = gravity + force / mass"
RIGHT = {
    "gravity": _ALL,
    "drive": "a_drive = drive * cos(frequency * t)",
    "damping": "a_damping = -damping * v / mass",
    "spring": _SPRING,
    "rest": _SPRING,
    "mass": _ALL,
    "velocity": "v = the initial velocity at t = 0",
}


def mass(place: TermPlace) -> float:
    """Of the node of a term."""
    return place.args.mass[place.node]


def _one_for_all(name: str, part: str, words: str, whole: str) -> tuple[Mistake, Mistake]:
    """The first of an array, or its mean, in place of each; `part` of a place is the index."""

    def factor(one: Callable[[np.ndarray], float]) -> Callable[[TermPlace], float]:
        def of(place: TermPlace) -> float:
            array = getattr(place.args, name)
            return float(one(array) / array[getattr(place, part)])

        return of

    return (
        Mistake(f"{words} the first {whole} for all", factor(lambda array: array[0])),
        Mistake(f"{words} the mean {whole} for all", factor(np.mean)),
    )


def _of_other_springs(name: str, words: str) -> tuple[Mistake, ...]:
    def factor(shift: int) -> Callable[[TermPlace], float]:
        def of(place: TermPlace) -> float:
            array = getattr(place.args, name)
            return float(array[(place.element + shift) % len(array)] / array[place.element])

        return of

    return (
        Mistake(f"{words} the next spring", factor(1)),
        Mistake(f"{words} the previous spring", factor(-1)),
        Mistake(
            f"{words} the springs in reverse order",
            lambda place: float(
                getattr(place.args, name)[-1 - place.element]
                / getattr(place.args, name)[place.element]
            ),
        ),
    )


def _rest_length(place: TermPlace) -> float:
    return place.args.rest_length[place.element]


# Of any term.
NUMBERS = (
    Mistake("is left out", lambda place: 0.0),
    Mistake("has the wrong sign", lambda place: -1.0),
    Mistake("is counted twice", lambda place: 2.0),
    Mistake("is counted half", lambda place: 0.5),
)
_OF_A_FORCE = (
    Mistake("is not divided by the mass", mass),
    Mistake("is divided by the mass twice", lambda place: 1.0 / mass(place)),
    Mistake("is divided by the first node's mass", lambda p: mass(p) / p.args.mass[0]),
    Mistake("is divided by the mean mass", lambda p: mass(p) / float(np.mean(p.args.mass))),
)
_OF_AN_ACCELERATION = (
    Mistake("is an acceleration, and is multiplied by the mass", mass),
    Mistake("is an acceleration, and is divided by the mass", lambda place: 1.0 / mass(place)),
    Mistake("is multiplied by the mass twice", lambda place: mass(place) ** 2),
)
# Those of the mass multiply all forces alike.
MISTAKES: dict[str, tuple[Mistake, ...]] = {
    "gravity": _OF_AN_ACCELERATION,
    "drive": _OF_AN_ACCELERATION,
    "damping": (*_OF_A_FORCE, *_one_for_all("damping", "node", "is that of", "node")),
    "spring": (
        *_OF_A_FORCE,
        Mistake("is divided by the rest length", lambda place: 1.0 / _rest_length(place)),
        Mistake("is multiplied by the rest length", _rest_length),
        *_one_for_all("stiffness", "element", "has the stiffness of", "spring"),
        *_of_other_springs("stiffness", "has the stiffness of"),
        Mistake(
            "is divided by the mass of the spring's other end",
            lambda p: mass(p) / p.args.mass[2 * p.element + 1 - p.node],
        ),
    ),
    "rest": (
        Mistake(
            "is truncated to a whole number", lambda p: np.trunc(_rest_length(p)) / _rest_length(p)
        ),
        Mistake(
            "is rounded to a whole number", lambda p: np.round(_rest_length(p)) / _rest_length(p)
        ),
        *_one_for_all("rest_length", "element", "is that of", "spring"),
        *_of_other_springs("rest_length", "is that of"),
        Mistake("is squared", _rest_length),
    ),
    "mass": (
        Mistake("is left out: forces are not divided by it", mass),
        Mistake("counts twice: forces are divided by it twice", lambda place: 1.0 / mass(place)),
        Mistake("multiplies forces in place of dividing them", lambda place: mass(place) ** 2),
        Mistake("of the first node is taken for all", lambda p: mass(p) / p.args.mass[0]),
        Mistake("is the mean of all nodes", lambda p: mass(p) / float(np.mean(p.args.mass))),
    ),
    "velocity": (),
}
