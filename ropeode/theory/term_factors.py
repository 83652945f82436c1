"""By which factor each term of a wrong equation is off, and in words which mistake makes it so."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from ropeode.theory.diagnosis import Fault
from ropeode.theory.rope_terms import TermPlace
from ropeode.theory.terms import KINDS, MISTAKES, NUMBERS, TERMS, Mistake, mass, times
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


def mistakes_in(factors: Sequence[Factor]) -> list[Fault]:
    """What is wrong with the terms of an equation.

    Arguments:
        factors: of all terms, at all nodes of several ropes.
    """
    wrong = [each for each in factors if not each.equals(1.0)]
    kinds = {each.kind for each in wrong}
    by_kind = {kind: [each for each in factors if each.kind == kind] for kind in KINDS}
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
    for kind in KINDS:
        if kind in kinds:
            subject = TERMS[kind].name
            if kind == "spring" and not any(each.kind == "rest" for each in wrong):
                subject = "the length in the spring force"
            moving = [each for each in by_kind[kind] if each.place.node not in still]
            own = _of_kind(kind, subject, moving)
            texts += [fault._replace(remedy=TERMS[kind].remedy) for fault in own]
    return texts


def _of_all(by_kind: dict[str, list[Factor]]) -> Fault | None:
    """A mistake with the mass, or with all forces; None if the terms are off in different ways."""
    forces = by_kind["spring"] + by_kind["rest"] + by_kind["damping"]
    accelerations = by_kind["gravity"] + by_kind["drive"]
    every = forces + accelerations
    if not all({each.value for each in by_kind[kind]} - {1.0} for kind in ("spring", "damping")):
        return None
    right = all(each.equals(1.0) for each in accelerations)
    for mistake in MISTAKES["mass"] if _of_several_ropes(every) else ():
        if _explains(mistake, forces if right else every):
            return Fault(f"the mass {mistake.words}", remedy=TERMS["mass"].remedy)
    if not forces[0].equals(1.0) and all(each.equals(forces[0].value) for each in forces):
        if right and not forces[0].equals(0.0):
            inverse = forces[0]._replace(value=1.0 / forces[0].value)
            return Fault(f"the mass {_times(inverse)}", remedy=TERMS["mass"].remedy)
        if all(each.equals(forces[0].value) for each in accelerations):
            return Fault(f"the acceleration {_times(forces[0])}", remedy=TERMS["all"].remedy)
    return _of_nodes(forces if right else every, right)


def _of_nodes(factors: list[Factor], right: bool) -> Fault | None:
    """A mass that is off at some nodes, or not the rope's; None if a node's terms disagree.

    Arguments:
        factors: of all forces, or of all terms.
        right: whether those that are left out are right.
    """
    nodes: dict[tuple[int, int], list[Factor]] = {}
    for each in factors:
        nodes.setdefault((each.place.node, id(each.place.args)), []).append(each)
    if any(
        each.equals(0.0) or not each.equals(of[0].value) for of in nodes.values() for each in of
    ):
        return None
    firsts = [of[0] for of in nodes.values()]
    wrong = [each for each in firsts if not each.equals(1.0)]
    if not wrong:
        return None
    if all(each.equals(wrong[0].value) for each in wrong):
        where = f"at node {listed(sorted({each.place.node for each in wrong}))}"
        if right:
            inverse = wrong[0]._replace(value=1.0 / wrong[0].value)
            return Fault(f"the mass {_times(inverse)} {where}", remedy=TERMS["mass"].remedy)
        return Fault(f"the acceleration {_times(wrong[0])} {where}", remedy=TERMS["all"].remedy)
    if not _of_several_ropes(factors):
        return None
    own = _own_numbers([(each.place.node, mass(each.place) / each.value) for each in firsts], wrong)
    return None if own is None else Fault(f"the mass is {own}", remedy=TERMS["mass"].remedy)


def _nodes_that_stand_still(factors: Sequence[Factor]) -> list[int]:
    """Nodes at which all terms are left out, unless they are so at all nodes."""
    nodes = sorted({each.place.node for each in factors})
    still = [
        node
        for node in nodes
        if all(each.equals(0.0) for each in factors if each.place.node == node)
    ]
    return [] if still == nodes else still


def _of_kind(kind: str, subject: str, factors: list[Factor]) -> list[Fault]:
    wrong = [each for each in factors if not each.equals(1.0)]
    if not wrong:
        return []
    several = _of_several_ropes(factors)
    for mistake in (*MISTAKES[kind], *NUMBERS) if several else NUMBERS:
        if _explains(mistake, factors):
            return [Fault(f"{subject} {mistake.words}")]
    if several and (own := _own_number(kind, factors)) is not None:
        subject = "the stiffness" if kind == "spring" else subject
        return [Fault(f"{subject} is {own}")]
    if several and kind == "damping" and (growth := _growth(factors)) is not None:
        return [Fault(f"there is an acceleration of {growth:.6g} times the velocity too much")]
    axes = sorted({each.place.element for each in wrong})
    if kind in ("gravity", "drive") and len(axes) < len({e.place.element for e in factors}):
        return [
            fault
            for axis in axes
            for fault in _of_kind(
                kind,
                f"the {'xyz'[axis]} component of {subject}",
                [each for each in factors if each.place.element == axis],
            )
        ]
    if all(each.equals(wrong[0].value) for each in wrong):
        text = f"{subject} {_times(wrong[0])}"
        return [Fault(text if len(wrong) == len(factors) else f"{text} {_where(kind, wrong)}")]
    low, high = (
        0.0 if each.equals(0.0) else each.value
        for pick in (min, max)
        for each in [pick(wrong, key=lambda factor: factor.value)]
    )
    text = f"{subject} is {low:.4g} to {high:.4g} times what it should be {_where(kind, wrong)}"
    return [Fault(text, named=False)]


def _of_several_ropes(factors: Sequence[Factor]) -> bool:
    """Whether the terms are of ropes with different parameters.

    One rope cannot tell a factor from one that depends on the parameters.
    """
    return len({id(each.place.args) for each in factors}) > 1


def _growth(factors: list[Factor]) -> float | None:
    """What is added to all damping rates, if it is the same for all nodes."""
    values = [
        (1.0 - each.value) * each.place.args.damping[each.place.node] / mass(each.place)
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
    off = factor.value - 1.0
    if abs(off) <= _FLOAT32:
        return f"is off by {off:.1e} of itself, as a constant in float32 makes it"
    return times(factor.value, factor.equals)


def _own_number(kind: str, factors: list[Factor]) -> str | None:
    """A number that stands in place of the problem's on all ropes."""
    claimed: dict[str, Callable[[TermPlace], float]] = {
        "gravity": lambda place: place.args.gravity.ravel()[place.element],
        "damping": lambda place: place.args.damping[place.node],
        "spring": lambda place: place.args.stiffness[place.element],
        "rest": lambda place: place.args.rest_length[place.element],
    }
    if kind not in claimed:
        return None
    parts = [(each.place.element, each.value * claimed[kind](each.place)) for each in factors]
    return _own_numbers(parts, factors, kind != "gravity")


def _own_numbers(
    parts: list[tuple[int, float]], factors: list[Factor], one: bool = True
) -> str | None:
    """Numbers that are the same on all ropes, in words; None if they are not.

    Arguments:
        parts: of which part each is, and the number.
        factors: that they are from.
        one: whether a single number stands for equal ones.
    """
    by_part: dict[int, list[float]] = {}
    for part, value in parts:
        by_part.setdefault(part, []).append(value)
    spread = max(each.spread for each in factors)

    def differ(values: list[float]) -> bool:
        return bool(np.ptp(values) > 4.0 * spread * (1.0 + abs(values[0])))

    if any(differ(values) for values in by_part.values()):
        return None
    means = [float(np.mean(values)) for _, values in sorted(by_part.items())]
    numbers = [_own_in_words(mean, spread) for mean in means]
    everywhere = "on every rope, whatever the problem says"
    if len(numbers) == 1 or (one and not differ(means)):
        return f"{numbers[0]} {everywhere}"
    if one:
        everywhere = f"at {listed(sorted(by_part))} {everywhere}, as if kept from the first rope"
    return f"({', '.join(numbers)}) {everywhere}"


def _own_in_words(value: float, spread: float) -> str:
    """A number with six digits, and whether float32 has rounded it."""
    text = f"{0.0 if abs(value) <= spread else value:.6g}"
    off, rounded = value - float(text), float(np.float32(float(text)))
    near = spread * (1.0 + abs(value))
    return f"{text} in float32" if abs(off) > near >= abs(value - rounded) else text


def _explains(mistake: Mistake, factors: list[Factor]) -> bool:
    return all(each.equals(mistake.factor(each.place)) for each in factors)
