"""By which factor each term of a wrong equation is off, and in words which mistake makes it so."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from ropeode.theory.diagnosis import Fault
from ropeode.theory.rope_terms import LENGTH, TermPlace
from ropeode.theory.terms import AXES, FACTORS, MISTAKES, TERMS, mass, times
from ropeode.validation import listed

# Of a number, what rounding two of its factors to float32 takes off at most.
_FLOAT32 = 2.0**-23


class Factor(NamedTuple):
    """By which factor a term is too large.

    Fields:
        kind: of the term, as `RopeTerm` has it.
        place: where it stands.
        value: 1 where it is right.
        spread: how far it may be off.
    """

    kind: str
    place: TermPlace
    value: float
    spread: float

    def equals(self, other: float) -> bool:
        """Whether it may be this number."""
        return abs(self.value - other) <= self.spread * (1.0 + abs(other))


# Of which terms the factors may be one at each node, and the name for what is then wrong.
_FORCES = ("damping", "spring", "rest")
_EVERY = ("gravity", "drive", *_FORCES)
_WHOLE = (("all", _EVERY), ("mass", _EVERY), ("mass", _FORCES))
# The number of a rope that makes a term, at a place. A mass divides what it makes.
_NUMBERS: dict[str, Callable[[TermPlace], float]] = {
    "gravity": lambda place: place.args.gravity.ravel()[place.element],
    "drive": lambda place: place.args.drive[place.element],
    "damping": lambda place: place.args.damping[place.node],
    "spring": lambda place: place.args.stiffness[place.element],
    "rest": lambda place: place.args.rest_length[place.element],
    "mass": mass,
}
_BY_AXIS = ("gravity", "drive")


def mistakes_in(factors: Sequence[Factor]) -> list[Fault]:
    """What is wrong with the terms of an equation.

    Arguments:
        factors: of all terms, at all nodes of several ropes.
    """
    still = _nodes_that_stand_still(factors)
    faults = [Fault(f"node {listed(still)} is held, though it is free")] if still else []
    factors = [each for each in factors if each.place.node not in still]
    kinds = {each.kind for each in factors}
    for name, some in _WHOLE if {"spring", "damping"} <= kinds else ():
        nodes = _at_each_node([each for each in factors if each.kind in some])
        # Without any force there is no mass.
        massless = name == "mass" and any(each.equals(0.0) for each in nodes)
        if not massless and (found := _named(name, TERMS[name].name, nodes)):
            faults += found
            factors = [each for each in factors if each.kind not in some]
    springs = {_element(each): each.value for each in factors if each.kind == "spring"}
    rests = [each for each in factors if each.kind == "rest"]
    subject = TERMS["spring"].name
    if all(each.equals(springs.get(_element(each), np.nan)) for each in rests):
        # One factor for both: it is the force that is off.
        factors = [each for each in factors if each.kind != "rest"]
    elif all(each.equals(1.0) for each in rests):
        subject = LENGTH
    for kind in _EVERY:
        own = [each for each in factors if each.kind == kind]
        words = subject if kind == "spring" else TERMS[kind].name
        faults += _named(kind, words, own) or _far_off(kind, words, own)
    return faults


def _element(factor: Factor) -> tuple[int, int, int]:
    return id(factor.place.args), factor.place.node, factor.place.element


def _at_each_node(factors: list[Factor]) -> list[Factor]:
    """The one factor of all terms at each node of each rope; none if they differ."""
    nodes: dict[tuple[int, int], list[Factor]] = {}
    for each in factors:
        nodes.setdefault(_element(each)[:2], []).append(each)
    firsts = [of[0] for of in nodes.values()]
    agree = all(each.equals(of[0].value) for of in nodes.values() for each in of)
    return firsts if agree else []


def _nodes_that_stand_still(factors: Sequence[Factor]) -> list[int]:
    """Nodes at which all terms are left out, unless they are so at all nodes."""
    moving = {each.place.node for each in factors if not each.equals(0.0)}
    return sorted({each.place.node for each in factors} - moving) if moving else []


def _named(name: str, subject: str, factors: list[Factor]) -> list[Fault]:
    """What is wrong with terms that one number makes; nothing if they are right, or nobody knows.

    Arguments:
        name: of `TERMS`.
        subject: of the sentence.
        factors: at all places.
    """
    wrong = [each for each in factors if not each.equals(1.0)]
    if not wrong:
        return []
    remedy = TERMS[name].remedy
    # One rope cannot tell a factor from one that depends on the parameters.
    several = len({id(each.place.args) for each in factors}) > 1
    for mistake in MISTAKES.get(name, ()) if several else ():
        if all(each.equals(mistake.factor(each.place)) for each in factors):
            return [Fault(f"{subject} {mistake.words}", remedy=remedy)]
    axes = {each.place.element for each in wrong}
    if name in _BY_AXIS and axes < {each.place.element for each in factors}:
        by_axis = {
            axis: [each for each in factors if each.place.element == axis] for axis in sorted(axes)
        }
        return [
            fault
            for axis, own in by_axis.items()
            for fault in _named(name, f"the {AXES[axis]} component of {subject}", own)
            or _far_off(name, subject, own)
        ]
    first = wrong[0]
    if all(each.equals(first.value) for each in wrong):
        shown = first._replace(value=1.0 / first.value) if name == "mass" else first
        everywhere = len(wrong) == len(factors)
        where = "" if everywhere else f" {_where(name, wrong)}"
        value = next((each for each in FACTORS.values() if first.equals(each)), first.value)
        term = (name if subject == TERMS[name].name else subject, value if everywhere else 1.0)
        return [Fault(f"{subject} {_times(shown)}{where}", remedy=remedy, term=term)]
    own = _own_numbers(name, factors) if several else None
    subject = "the stiffness" if name == "spring" else subject
    return [Fault(f"{subject} is {own}", remedy=remedy)] if own else []


def _far_off(kind: str, subject: str, factors: list[Factor]) -> list[Fault]:
    """How far terms are off, if nobody knows why."""
    wrong = sorted((each for each in factors if not each.equals(1.0)), key=lambda each: each.value)
    if not wrong:
        return []
    low, high = (0.0 if each.equals(0.0) else each.value for each in (wrong[0], wrong[-1]))
    text = f"{subject} is {low:.4g} to {high:.4g} times what it should be {_where(kind, wrong)}"
    return [Fault(text, named=False, remedy=TERMS[kind].remedy)]


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
    off = factor.value - 1.0
    if abs(off) <= _FLOAT32:
        return f"is off by {off:.1e} of itself, as a constant in float32 makes it"
    return times(factor.value, factor.equals)


def _own_numbers(name: str, factors: list[Factor]) -> str | None:
    """The numbers that stand in place of the problem's, in words; None if ropes have others.

    Arguments:
        name: of `_NUMBERS`; others have no number.
        factors: at all places of several ropes.
    """
    if name not in _NUMBERS:
        return None
    parts: dict[int, list[float]] = {}
    for each in factors:
        number = _NUMBERS[name](each.place)
        part = each.place.node if name == "mass" else each.place.element
        own = number / each.value if name == "mass" else number * each.value
        parts.setdefault(part, []).append(own)
    spread = max(each.spread for each in factors)
    if any(np.ptp(values) > 4.0 * spread * (1.0 + abs(values[0])) for values in parts.values()):
        return None
    means = [float(np.mean(parts[part])) for part in sorted(parts)]
    texts = [f"{0.0 if abs(mean) <= spread else mean:.6g}" for mean in means]
    numbers = texts[0] if len(set(texts)) == 1 else f"({', '.join(texts)})"
    if name in _BY_AXIS or numbers == texts[0]:
        return f"{numbers} on every rope, whatever the problem says"
    return (
        f"{numbers} at {listed(sorted(parts))} on every rope, whatever the problem says, as if "
        "kept from the first rope"
    )
