"""The terms of a rope's equations, what people make of them by mistake, and what is right.

A wrong coefficient is found in three ways: from single steps, from the numbers in files, and from
the limit of their runs. All three say it with this table.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from ropeode.theory.rope_terms import LAWS, TermPlace


class Term(NamedTuple):
    """A part of the equations, or of a program, that may be wrong.

    Fields:
        name: as the words of a diagnosis have it.
        remedy: how the line of a program should be; d leads to a spring's other end.
        expected: the right value of its factor; 0 for what is not there.
        starts: from which a wrong value is looked for.
    """

    name: str
    remedy: str
    expected: float = 1.0
    starts: tuple[float, ...] = (1.0,)


class Mistake(NamedTuple):
    """What a mistake makes of a term.

    Fields:
        words: what follows the subject, such as "the damping".
        factor: by which it multiplies the term, at a place.
    """

    words: str
    factor: Callable[[TermPlace], float]


AXES = ("x", "y", "z")


def along_axes(there: np.ndarray) -> str:
    """In words, along which axes something is there; empty if along all, or along none.

    Arguments:
        there: whether it is, ``(dim,)``.
    """
    axes = [axis for axis, each in zip(AXES, there, strict=False) if each]
    return "" if len(axes) in (0, len(there)) else f", along {' and '.join(axes)} alone"


# How closely factors are the same.
_SAME = 1e-12
_ALL = "a = gravity + force / mass"
_SPRING = "a_spring = stiffness * (length - rest_length) * d / length / mass"
_DAMPING = "a_damping = -damping * v / mass"
_START = "v = the initial velocity at t = 0"
_ENDS = "f[i] += pull; f[i + 1] -= pull"
_NO_FACTOR = "leave it out, or scale it with dt: v *= exp(-rate * dt), or a damping force"
_ZERO = "set the forces on all nodes to zero before each step"
_ANY, _THERE = (1.0, -1.0, 0.5, 2.0), (1.0, 0.0)
TERMS = {
    "gravity": Term("gravity", _ALL),
    "drive": Term("the driving force", "a_drive = drive * cos(frequency * t)"),
    "damping": Term("the damping", _DAMPING, starts=_THERE),
    # A force proportional to the length, and the constant one that is taken off it.
    "spring": Term("the spring force", _SPRING, starts=_ANY),
    "rest": Term("the rest length", _SPRING, starts=_THERE),
    # A mass divides all forces.
    "mass": Term("the mass", _ALL),
    "forces": Term("the sum of all forces but gravity", _ALL, starts=_ANY),
    "all": Term("the acceleration", "v_new = v + dt * a", starts=_ANY),
    "velocity": Term("the initial velocity", _START, starts=_THERE),
    "first_ends": Term("the pull of springs on the node before them", _ENDS, starts=_THERE),
    "second_ends": Term("the pull of springs on the node behind them", _ENDS, starts=_THERE),
    # A velocity is multiplied after the forces have seen it, before they do, or at the end.
    **{
        name: Term("the velocity kept by a step", _NO_FACTOR, starts=(1.0, 0.99))
        for name in ("kept", "kept_first", "kept_last")
    },
    "further": Term("a further damping of nodes", _DAMPING, 0.0, (0.0,)),
    "dashpot": Term("a damping along each spring", _SPRING, 0.0, (0.0,)),
    "per_spring": Term("a damping of each spring's two nodes", _DAMPING, 0.0, (0.0,)),
    "old_forces": Term("the forces kept from the step before", _ZERO, 0.0, (0.0, 1.0)),
    "old_gravity": Term("the gravity kept from the step before", _ZERO, 0.0, (0.0, 1.0)),
    # What is added to gravity, and to the initial velocity of all free nodes.
    **{
        f"{name}_{axis}": Term(f"{words} along {axis}", remedy, 0.0, (0.0,))
        for name, words, remedy in (
            ("gravity", "an additional gravity", _ALL),
            ("velocity", "an additional initial velocity", _START),
        )
        for axis in AXES
    },
}


def said(name: str, value: float, equals: Callable[[float], bool] | None = None) -> str:
    """A sentence: what is wrong with a term.

    Arguments:
        name: of `TERMS`.
        value: its factor, or its coefficient if there should be no such term.
        equals: whether the value may be another number; exactly if it is not given.
    """
    term = TERMS[name]
    if term.expected == 0.0:
        return f"there is {term.name}, of coefficient {value:g}"
    # Without any force there is no mass, and none is negative.
    if name == "forces" and value > 0.0:
        return said("mass", 1.0 / value)
    return f"{term.name} {times(value, equals)}"


def by_power(name: str, exponent: float) -> str:
    """A sentence: a term is multiplied by a power of dt that it should not have."""
    if exponent < 0.0:
        return f"{TERMS[name].name} is divided by dt, or dt is missing there"
    return f"{TERMS[name].name} is multiplied by dt {'once' if exponent == 1.0 else 'twice'} more"


def times(value: float, equals: Callable[[float], bool] | None = None) -> str:
    """What follows the subject where a term has a factor; arguments as for `said`."""
    for mistake, factor in FACTORS.items():
        if equals(factor) if equals else value == factor:
            return mistake
    off = value - 1.0
    if abs(off) < 0.5:
        return f"is {100.0 * abs(off):.4g}% too {'large' if off > 0 else 'small'}"
    return f"is {value:.6g} times what it should be"


def mass(place: TermPlace) -> float:
    """Of the node of a term."""
    return place.args.mass[place.node]


# What people take in place of an element of an array, from the array and the element's index.
_INSTEAD: dict[str, Callable[[np.ndarray, int], Any]] = {
    "the first {} for all": lambda array, i: array[0],
    "the mean {} for all": lambda array, i: np.mean(array),
    "the next {}": lambda array, i: array[(i + 1) % len(array)],
    "the previous {}": lambda array, i: array[i - 1],
    "the {}s in reverse order": lambda array, i: array[-1 - i],
}


def _of_another(name: str, verb: str, whole: str) -> tuple[Mistake, ...]:
    """The number of another node or spring in place of its own."""

    def factor(pick: Callable[[np.ndarray, int], Any]) -> Callable[[TermPlace], float]:
        def of(place: TermPlace) -> float:
            array, i = getattr(place.args, name), place.element
            return float(pick(array, i) / array[i])

        return of

    return tuple(
        Mistake(f"{verb} {words.format(whole)}", factor(pick)) for words, pick in _INSTEAD.items()
    )


def _rest_length(place: TermPlace) -> float:
    return place.args.rest_length[place.element]


# Of any term.
FACTORS = {
    "is left out": 0.0,
    "has the wrong sign": -1.0,
    "is counted twice": 2.0,
    "is counted half": 0.5,
}


def _times(words: str, factor: float) -> Mistake:
    return Mistake(words, lambda place: factor)


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
    Mistake("is that of the whole rope's mass", lambda p: float(np.sum(p.args.mass)) / mass(p)),
    Mistake("is that of the mean mass", lambda p: float(np.mean(p.args.mass)) / mass(p)),
)
# Those of the mass multiply all forces alike.
MISTAKES: dict[str, tuple[Mistake, ...]] = {
    "gravity": _OF_AN_ACCELERATION,
    "drive": _OF_AN_ACCELERATION,
    "damping": (*_OF_A_FORCE, *_of_another("damping", "is that of", "node")),
    "spring": (
        *_OF_A_FORCE,
        Mistake("is divided by the rest length", lambda place: 1.0 / _rest_length(place)),
        Mistake("is multiplied by the rest length", _rest_length),
        Mistake(
            "is multiplied by the rest length in place of the stiffness",
            lambda p: _rest_length(p) / p.args.stiffness[p.element],
        ),
        *_of_another("stiffness", "has the stiffness of", "spring"),
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
        *_of_another("rest_length", "is that of", "spring"),
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


class KnownMistake(NamedTuple):
    """A mistake of `MISTAKES`, `FACTORS` or `LAWS` on one rope.

    Fields:
        kind: of the term.
        words: what follows its name.
        values: of terms, for each node or spring; 1 of another law.
        number: by which it multiplies a term, if it is the same everywhere on this rope.
    """

    kind: str
    words: str
    values: Mapping[str, np.ndarray]
    number: float | None = None


def known_mistakes(args: Any) -> list[KnownMistake]:
    """The mistakes that change the motion of a rope.

    Of those that change it alike the first; but one without a number of its own hides none that is
    the same number for any rope.

    Arguments:
        args: the rope's numbers.
    """
    at_nodes = [TermPlace(args, node, node) for node in range(len(args.mass))]
    springs = range(len(args.rest_length) if hasattr(args, "stiffness") else 0)
    at_ends = [[TermPlace(args, i + end, i) for i in springs] for end in (0, 1)]
    places = {
        "mass": {"forces": at_nodes},
        "gravity": {"gravity": at_nodes},
        "damping": {"damping": at_nodes},
        "spring": dict(zip(("first_ends", "second_ends"), at_ends, strict=True)),
        "rest": {"rest": at_ends[0]},
        "first_ends": {"first_ends": at_ends[0]},
        "second_ends": {"second_ends": at_ends[1]},
        "forces": {"forces": at_nodes},
    }
    found: dict[tuple[bool, bytes], KnownMistake] = {}
    for kind in places if springs else ("gravity", "damping"):
        numbers = _numbers(kind)
        for mistake in (*MISTAKES.get(kind, ()), *numbers):
            with np.errstate(all="ignore"):  # A length or a damping of zero.
                values = {
                    name: np.array([mistake.factor(place) for place in at])
                    for name, at in places[kind].items()
                }
            effect = _effect(args, values)
            changed = np.concatenate(effect)
            if not np.all(np.isfinite(changed)) or np.allclose(changed, 1.0, rtol=0.0, atol=_SAME):
                continue
            own = np.concatenate([part for part in effect if not np.all(part == 1.0)])
            number = float(own[0]) if np.ptp(own) <= _SAME * abs(own[0]) else None
            key = mistake in numbers, np.round(changed, 12).tobytes()
            found.setdefault(key, KnownMistake(kind, mistake.words, values, number))
    laws = [
        KnownMistake(law.kind, law.words, {name: np.ones(1)})
        for name, law in LAWS.items()
        if (springs if law.kind == "spring" else np.any(args.damping))
    ]
    return [*found.values(), *laws]


def _numbers(kind: str) -> tuple[Mistake, ...]:
    """One factor for all; those that a mass may have, which divides all forces, and is positive."""
    if kind == "mass":
        return tuple(_times(words, 1.0 / factor) for words, factor in FACTORS.items() if factor > 0)
    signs = [words for words, factor in FACTORS.items() if kind != "forces" or factor <= 0]
    return tuple(_times(words, FACTORS[words]) for words in signs)


def _effect(args: Any, values: Mapping[str, np.ndarray]) -> list[np.ndarray]:
    """The factors of all terms that a rope has, at its free nodes and at its springs."""

    def of(name: str) -> np.ndarray:
        return values.get(name, np.ones(1))

    free, forces = args.free != 0.0, of("forces") * np.ones(len(args.mass))
    damped = free & (args.damping != 0.0)
    effect = [(of("damping") * forces)[damped]]
    if np.any(args.gravity):
        effect.append((of("gravity") * np.ones(len(free)))[free])
    if hasattr(args, "stiffness"):
        effect.append((of("first_ends") * forces[:-1])[free[:-1]])
        effect.append((of("second_ends") * forces[1:])[free[1:]])
        effect.append(of("rest"))
    return effect
