"""By which factor each term of a wrong equation is off, and in words which mistake makes it so."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from ropeode.theory.rope_terms import Place
from ropeode.validation import listed


class Factor(NamedTuple):
    """By which factor a term is too large.

    Fields:
        kind: of the term, as `RopeTerm` has it.
        place: where it stands.
        value: 1 where it is right.
        spread: how far it may be off.
    """

    kind: str
    place: Place
    value: float
    spread: float

    def equals(self, other: float) -> bool:
        """Whether it may be this number."""
        return abs(self.value - other) <= self.spread * (1.0 + abs(other))


class _Mistake(NamedTuple):
    """What a mistake makes of a factor.

    Fields:
        words: what follows the subject, such as "the damping".
        value: the factor, at a place.
    """

    words: str
    value: Callable[[Place], float]


class Fault(NamedTuple):
    """Something that is wrong.

    Fields:
        words: that say it.
        named: whether they name the mistake; if not, they only say how far off a term is.
    """

    words: str
    named: bool = True


SUBJECTS = {
    "gravity": "gravity",
    "drive": "the driving force",
    "damping": "the damping",
    "spring": "the spring force",
    "rest": "the rest length",
}


def mistakes_in(factors: Sequence[Factor]) -> list[Fault]:
    """What is wrong with the terms of an equation.

    Arguments:
        factors: of all terms, at all nodes of several ropes.
    """
    wrong = [each for each in factors if not each.equals(1.0)]
    kinds = {each.kind for each in wrong}
    by_kind = {kind: [each for each in factors if each.kind == kind] for kind in SUBJECTS}
    if whole := _of_all(by_kind):
        return [whole]
    still = _nodes_that_stand_still(factors)
    texts = [Fault(f"node {listed(still)} is held, though it is free")] if still else []
    springs = {(id(each.place.args), *each.place[1:]): each.value for each in by_kind["spring"]}
    if kinds & {"spring", "rest"} and all(
        each.equals(springs.get((id(each.place.args), *each.place[1:]), np.nan))
        for each in by_kind["rest"]
    ):
        # One factor for both: it is the force that is off.
        kinds -= {"rest"}
    for kind in SUBJECTS:
        if kind in kinds:
            texts += _of_kind(kind, [e for e in by_kind[kind] if e.place.node not in still])
    return texts


def _of_all(by_kind: dict[str, list[Factor]]) -> Fault | None:
    """A mistake with the mass, or with all forces; None if the terms are off in different ways."""
    forces = by_kind["spring"] + by_kind["rest"] + by_kind["damping"]
    accelerations = by_kind["gravity"] + by_kind["drive"]
    every = forces + accelerations
    if not all({each.value for each in by_kind[kind]} - {1.0} for kind in ("spring", "damping")):
        return None
    right = all(each.equals(1.0) for each in accelerations)
    for mistake in (*_MASS, *_MASS_ALONE) if right else _MASS:
        if _explains(mistake, forces if right else every):
            return Fault(f"the mass {mistake.words}")
    if not every[0].equals(1.0) and all(each.equals(every[0].value) for each in every):
        return Fault(f"the acceleration {_times(every[0])}")
    return None


def _nodes_that_stand_still(factors: Sequence[Factor]) -> list[int]:
    """Nodes at which all terms are left out, unless they are so at all nodes."""
    nodes = sorted({each.place.node for each in factors})
    still = [
        node
        for node in nodes
        if all(each.equals(0.0) for each in factors if each.place.node == node)
    ]
    return [] if still == nodes else still


def _of_kind(kind: str, factors: list[Factor]) -> list[Fault]:
    subject = SUBJECTS[kind]
    wrong = [each for each in factors if not each.equals(1.0)]
    if not wrong:
        return []
    for mistake in (*_MISTAKES[kind], *_NUMBERS):
        if _explains(mistake, factors):
            return [Fault(f"{subject} {mistake.words}")]
    if (own := _own_number(kind, factors)) is not None:
        return [Fault(f"{subject} is {own} on every rope, whatever the problem says")]
    if kind == "damping" and (growth := _growth(factors)) is not None:
        return [Fault(f"there is an acceleration of {growth:.6g} times the velocity too much")]
    axes = sorted({each.place.element for each in wrong})
    if kind in ("gravity", "drive") and len(axes) < len({e.place.element for e in factors}):
        return [
            Fault(text.words.replace(subject, f"the {'xyz'[axis]} component of {subject}"))
            if text.named
            else text
            for axis in axes
            for text in _of_kind(kind, [each for each in factors if each.place.element == axis])
        ]
    if all(each.equals(wrong[0].value) for each in wrong):
        text = f"{subject} {_times(wrong[0])}"
        return [Fault(text if len(wrong) == len(factors) else f"{text} {_where(kind, wrong)}")]
    low, high = (pick(each.value for each in wrong) for pick in (min, max))
    text = f"{subject} is {low:.4g} to {high:.4g} times what it should be {_where(kind, wrong)}"
    return [Fault(text, named=False)]


def _growth(factors: list[Factor]) -> float | None:
    """What is added to all damping rates, if it is the same for all nodes."""
    values = [
        (1.0 - each.value) * each.place.args.damping[each.place.node] / _mass(each.place)
        for each in factors
    ]
    return values[0] if np.ptp(values) <= factors[0].spread * (1.0 + abs(values[0])) else None


def _where(kind: str, wrong: list[Factor]) -> str:
    nodes = sorted({each.place.node for each in wrong})
    springs = sorted({each.place.element for each in wrong})
    if kind in ("spring", "rest"):
        ends = {each.place.node - each.place.element for each in wrong}
        if len(ends) == 1 and len(springs) > 1:
            return f"at the {'first' if ends == {0} else 'second'} node of each spring"
        return f"in spring {listed(springs)}, at node {listed(nodes)}"
    return f"at node {listed(nodes)}"


def _times(factor: Factor) -> str:
    for mistake in _NUMBERS:
        if factor.equals(mistake.value(factor.place)):
            return mistake.words
    off = factor.value - 1.0
    if abs(off) < 0.5:
        return f"is {100.0 * abs(off):.4g}% too {'large' if off > 0 else 'small'}"
    return f"is {factor.value:.6g} times what it should be"


def _own_number(kind: str, factors: list[Factor]) -> str | None:
    """A number that stands in place of the problem's on all ropes."""
    claimed: dict[str, Callable[[Place], float]] = {
        "gravity": lambda place: place.args.gravity.ravel()[place.element],
        "damping": lambda place: place.args.damping[place.node],
        "spring": lambda place: place.args.stiffness[place.element],
        "rest": lambda place: place.args.rest_length[place.element],
    }
    if kind not in claimed:
        return None
    by_part: dict[int, list[float]] = {}
    for each in factors:
        part = each.place.element if kind == "gravity" else 0
        by_part.setdefault(part, []).append(each.value * claimed[kind](each.place))
    spread = factors[0].spread
    if any(np.ptp(values) > spread * (1.0 + abs(values[0])) for values in by_part.values()):
        return None
    means = [float(np.mean(values)) for _, values in sorted(by_part.items())]
    numbers = [f"{0.0 if abs(mean) <= spread else mean:.6g}" for mean in means]
    return numbers[0] if len(numbers) == 1 else f"({', '.join(numbers)})"


def _explains(mistake: _Mistake, factors: list[Factor]) -> bool:
    return all(each.equals(mistake.value(each.place)) for each in factors)


def _mass(place: Place) -> float:
    return place.args.mass[place.node]


def _first_for_all(name: str, part: str) -> _Mistake:
    def value(place: Place) -> float:
        array = getattr(place.args, name)
        return array[0] / array[getattr(place, part)]

    noun = name.replace("_", " ")
    return _Mistake(f"takes the first {noun} for all", value)


def _mean_for_all(name: str, part: str) -> _Mistake:
    def value(place: Place) -> float:
        array = getattr(place.args, name)
        return float(np.mean(array)) / array[getattr(place, part)]

    return _Mistake(f"takes the mean {name.replace('_', ' ')} for all", value)


def _next(name: str, shift: int) -> _Mistake:
    def value(place: Place) -> float:
        array = getattr(place.args, name)
        return array[(place.element + shift) % len(array)] / array[place.element]

    which = "next" if shift > 0 else "previous"
    return _Mistake(f"takes the {name.replace('_', ' ')} of the {which} spring", value)


_NUMBERS = (
    _Mistake("is left out", lambda place: 0.0),
    _Mistake("has the wrong sign", lambda place: -1.0),
    _Mistake("is counted twice", lambda place: 2.0),
    _Mistake("is counted half", lambda place: 0.5),
)
_MASS = (
    _Mistake("is left out: forces are not divided by it", _mass),
    _Mistake("counts twice: forces are divided by it twice", lambda place: 1.0 / _mass(place)),
    _Mistake("multiplies forces in place of dividing them", lambda place: _mass(place) ** 2),
    _Mistake("of the first node is taken for all", lambda p: _mass(p) / p.args.mass[0]),
    _Mistake("is the mean of all nodes", lambda p: _mass(p) / float(np.mean(p.args.mass))),
)
# Where gravity is right.
_MASS_ALONE = (
    _Mistake("is counted twice", lambda place: 0.5),
    _Mistake("is counted half", lambda place: 2.0),
)
_OF_A_FORCE = (
    _Mistake("is not divided by the mass", _mass),
    _Mistake("is divided by the mass twice", lambda place: 1.0 / _mass(place)),
    _Mistake("is divided by the first node's mass", lambda p: _mass(p) / p.args.mass[0]),
    _Mistake("is divided by the mean mass", lambda p: _mass(p) / float(np.mean(p.args.mass))),
)
_OF_AN_ACCELERATION = (
    _Mistake("is an acceleration, and is multiplied by the mass", _mass),
    _Mistake("is an acceleration, and is divided by the mass", lambda place: 1.0 / _mass(place)),
    _Mistake("is multiplied by the mass twice", lambda place: _mass(place) ** 2),
)
_MISTAKES: dict[str, tuple[_Mistake, ...]] = {
    "gravity": _OF_AN_ACCELERATION,
    "drive": _OF_AN_ACCELERATION,
    "damping": (
        *_OF_A_FORCE,
        _first_for_all("damping", "node"),
        _mean_for_all("damping", "node"),
    ),
    "spring": (
        *_OF_A_FORCE,
        _Mistake("is divided by the rest length", lambda p: 1.0 / p.args.rest_length[p.element]),
        _Mistake("is multiplied by the rest length", lambda p: p.args.rest_length[p.element]),
        _first_for_all("stiffness", "element"),
        _mean_for_all("stiffness", "element"),
        _next("stiffness", 1),
        _next("stiffness", -1),
        _Mistake(
            "is divided by the mass of the spring's other end",
            lambda p: _mass(p) / p.args.mass[2 * p.element + 1 - p.node],
        ),
    ),
    "rest": (
        _Mistake(
            "is truncated to a whole number",
            lambda p: np.trunc(p.args.rest_length[p.element]) / p.args.rest_length[p.element],
        ),
        _Mistake(
            "is rounded to a whole number",
            lambda p: np.round(p.args.rest_length[p.element]) / p.args.rest_length[p.element],
        ),
        _first_for_all("rest_length", "element"),
        _mean_for_all("rest_length", "element"),
        _next("rest_length", 1),
        _next("rest_length", -1),
        _Mistake("is squared", lambda p: p.args.rest_length[p.element]),
    ),
}
