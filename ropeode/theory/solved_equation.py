"""The equation that a step solves, where it is not the rope's."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from ropeode.theory.changed_parameters import common_pace
from ropeode.theory.diagnosis import Diagnosis, Fault
from ropeode.theory.expansion import Expansion
from ropeode.theory.projection import projected
from ropeode.theory.rope_terms import (
    NOT_JOINED,
    OF_ZERO,
    OTHER_LAWS,
    PER_DAMPING,
    Motion,
    RopeTerm,
    TermPlace,
    other_terms,
    own_terms,
)
from ropeode.theory.step_at_zero import position_faults
from ropeode.theory.terms import AXES, FACTORS, MISTAKES, TERMS, by_power, mass, times
from ropeode.theory.whereabouts import where_off
from ropeode.validation import listed, numbered

# How the sentence of a diagnosis begins.
SOLVES_ANOTHER = "at dt = 0 the step solves another equation: "
# What may be left over of the difference from the right equation, as a part of the equation.
_EXPLAINED = 1e-6
# How far a coefficient may be off at least, and in units of what the error that is left over makes
# of it at most.
_SPREAD, _UNCERTAIN = 1e-9, 3.0
# An explanation with coefficients that are less certain says nothing.
_VAGUE = 1e-2
# Of a number, what rounding two of its factors to float32 takes off at most, and many of them.
_FLOAT32, _FEW_DIGITS = 2.0**-23, 1e-6
_DT_AS_GIVEN = "use dt as it is given: x_new = x + dt * v, v_new = v + dt * a"
_PINS = "let the acceleration and the velocity of pinned nodes be 0"
# Of which numbers of a node the coefficients of a force are multiples.
_SCALES: dict[str, Callable[[TermPlace], float]] = {
    "": lambda place: 1.0,
    " / mass": lambda place: 1.0 / mass(place),
    " * mass": mass,
    PER_DAMPING: lambda place: place.args.damping[place.node] / mass(place),
}
# The numbers of a rope by which a term is changed; all that accelerate it, for the acceleration.
_MADE_BY = {
    **{name: (name,) for name in ("gravity", "drive", "damping")},
    "spring": ("stiffness",),
    "rest": ("rest_length",),
    "all": ("gravity", "drive", "damping", "stiffness"),
}
# How closely what a term changes grows with the square of dt; what is nothing beside it.
_SQUARED, _TINY = 0.1, 1e-300
_ONCE = "multiply each force by dt once: v_new = v + dt * a"
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


def diagnose_equation(
    expansions: Sequence[Expansion], kept: np.ndarray | None = None
) -> Diagnosis | None:
    """What a step solves in place of the rope's equations, from its vector field at dt = 0.

    Arguments:
        expansions: of the step.
        kept: by which factor the step multiplies the velocity of each node, ``(ropes, nodes)``, if
            it does: then it may multiply what it adds to them as well.

    Returns:
        None if it solves the right ones.
    """
    moved = any(np.any(each.rate(0).known[0]) for each in expansions)
    accelerated = any(np.any(each.rate(0).known[1]) for each in expansions)
    if not (moved or accelerated):
        return None
    if kept is None and (pace := _pace(expansions)) is not None:
        return pace
    evidence: dict = {}
    faults = [
        *(_pins(expansions, "pinned nodes move", 0) if moved else []),
        *(position_faults(expansions, kept, evidence) if moved else []),
        *(_pins(expansions, "pinned nodes are accelerated", 1) if accelerated else []),
        *(_velocities(expansions, kept, evidence) if accelerated else []),
    ]
    faults = [_looked_into(fault, expansions) for fault in faults]
    if kept is not None and not all(fault.named for fault in faults or [Fault("", named=False)]):
        # What it loses at each step is mixed with what it adds.
        return None
    texts = [fault.words for fault in faults]
    if not texts:
        off = max(float(np.max(np.abs(each.rate(0).value))) for each in expansions)
        texts = [f"its vector field is off by {off:.1e}"]
    if "rest" in evidence:
        texts[-1] += f" (all else is right to {max(evidence['rest'], 1e-16):.0e})"
    line = SOLVES_ANOTHER + "; ".join(texts)
    remedies = dict.fromkeys(fault.remedy for fault in faults if fault.remedy)
    return Diagnosis("equation", line, evidence, "; ".join(remedies))


def _looked_into(fault: Fault, expansions: Sequence[Expansion]) -> Fault:
    """A fault that single steps of other kinds tell more about: they are made."""
    name, factor = fault.term
    if name == OF_ZERO and any(map(_starts_anew, expansions)):
        return fault._replace(words=f"{fault.words} at the start of each run")
    if factor == 0.0 and name in _MADE_BY and all(_is_with_dt(name, each) for each in expansions):
        return Fault(by_power(name, 1.0), remedy=_ONCE)
    if (name, factor) == ("all", 0.5) and all(map(_is_mean_velocity, expansions)):
        return Fault(
            "the acceleration is counted half in the velocity, which is (x_new - x)/dt: that is "
            "the mean velocity of the step, and contains dt/2 a",
            remedy="v_new = (x_new - x) / dt + dt / 2 * a",
        )
    return fault


def _starts_anew(own: Expansion) -> bool:
    """Whether two steps in a row end elsewhere than one after another, of which each is first."""
    dt = own.ladder / 8.0
    once, twice = np.moveaxis(own.samples.after(own.t, own.y, dt[:, None], 2)[:, 0, 1:], 1, 0)
    again = own.samples.after(own.t + dt, once, dt[:, None], 1)[:, 0, 1]
    return bool(np.max(np.abs(again - twice)) > _SPREAD * np.max(np.abs(twice)))


def _is_with_dt(name: str, own: Expansion) -> bool:
    """Whether a term that is left out at dt = 0 changes velocities by dt^2."""
    dt, args = own.ladder[:, None] / 8.0 * np.array([1.0, 0.5]), own.problem.args
    others = {field: 0.5 * getattr(args, field) for field in _MADE_BY[name]}
    halved = own.samples.on(own.problem.changed(args=args._replace(**others)))
    before, after = (of.after(own.t, own.y, dt, 1)[:, :, 1, 1] for of in (own.samples, halved))
    long, short = np.max(np.abs(before - after), axis=(0, 2, 3)) + _TINY
    return bool(abs(np.log2(long / short) - 2.0) < _SQUARED)


def _is_mean_velocity(own: Expansion) -> bool:
    """Whether the new velocity is the difference of the positions, divided by dt."""
    after = _after(own)
    mean = 8.0 * (after[:, 0] - own.y[:, 0]) / own.ladder[:, None, None]
    return bool(np.max(np.abs(mean - after[:, 1])) <= _EXPLAINED * np.max(np.abs(mean)))


def _pace(expansions: Sequence[Expansion]) -> Diagnosis | None:
    """The same factor on everything: time runs too fast or too slowly."""
    if (found := common_pace(expansions)) is None:
        return None
    pace = 1.0 + float(found.coefficients[0])
    near, spread = abs(pace - 1.0), _UNCERTAIN * float(found.spread[0])
    if near <= max(spread, _SPREAD):
        return None
    if near <= _FEW_DIGITS:
        return Diagnosis(
            "digits",
            f"at dt = 0 positions and velocities both change at a rate that is off by {near:.1e} "
            "of itself: a number of the method has few digits, as 0.1666667 has, or those of "
            "float32",
            {"pace": pace, "rest": found.rest},
            "write fractions as such (dt / 6), in float64",
        )
    if abs(pace) < _EXPLAINED and not any(np.any(_after(each) != each.y) for each in expansions):
        line = "the step does not move at all"
        return Diagnosis("equation", line, {"pace": 0.0}, _DT_AS_GIVEN)
    return Diagnosis(
        "pace",
        f"time runs {pace:.6g} times as fast as it should: at dt = 0 positions and velocities both "
        f"change at {pace:.6g} times the right rate, as if the weights of the method added up to "
        "this factor, or the step used another dt",
        {"pace": pace, "rest": found.rest},
        "let the weights of the slopes add up to 1",
    )


def _after(expansion: Expansion) -> np.ndarray:
    """The states after a step that is not long."""
    dt = expansion.ladder[:, None] / 8.0
    return expansion.samples.after(expansion.t, expansion.y, dt, 1)[:, 0, 1]


class _Node(NamedTuple):
    """The acceleration of a free node.

    Fields:
        off: the difference from the right one, flat.
        own: the rope's own terms of it.
        others: terms of other laws, by their names.
        kept: the factor by which the step multiplies the velocity; not-a-number if by none.
    """

    off: np.ndarray
    own: list[RopeTerm]
    others: dict[str, list[RopeTerm]]
    kept: float


class _Explanation(NamedTuple):
    """A sum of terms that makes up the difference from the right acceleration.

    Fields:
        faults: in words.
        factors: of the rope's own terms.
        rest: what is left over.
        others: how many of the terms are not the rope's.
    """

    faults: list[Fault]
    factors: list[Factor]
    rest: float
    others: int

    @property
    def plain(self) -> tuple[int, int, int]:
        """The fewest faults without a name, then forces that no rope has, then faults."""
        unnamed = sum(not fault.named for fault in self.faults)
        return unnamed, self.others, len(self.faults)


def _velocities(
    expansions: Sequence[Expansion], kept: np.ndarray | None, evidence: dict
) -> list[Fault]:
    """Which terms of the acceleration are off by which factors, or what else is in it."""
    size = max(float(np.max(np.abs(each.slopes[:, 1]))) for each in expansions)
    nodes = []
    for i, each in enumerate(expansions):
        motion = Motion(each.problem.args, each.t, each.y[:, 0], each.y[:, 1])
        for node in np.flatnonzero(each.problem.args.free).tolist():
            off, factor = each.rate(0).value[:, 1, node], np.nan if kept is None else kept[i, node]
            others = {law: other_terms(motion, node, law) for law in OTHER_LAWS}
            nodes.append(_Node(off.ravel(), own_terms(motion, node), others, float(factor)))
    found: list[_Explanation] = []
    for several in range(3):
        tried = (
            _explanation(nodes, size, law) for law in itertools.combinations(OTHER_LAWS, several)
        )
        found += [each for each in tried if each is not None]
        # Two at once explain much: only where nothing simpler names all.
        if several and any(not each.plain[0] for each in found):
            break
    if not found:
        return [_unexplained(expansions, size, evidence)]
    best = min(found, key=lambda each: each.plain)
    evidence["factors"] = {
        kind: sorted({float(f"{each.value:.6g}") for each in best.factors if each.kind == kind})
        for kind in dict.fromkeys(each.kind for each in best.factors)
    }
    evidence["rest"] = best.rest / size
    return best.faults


def _explanation(nodes: Sequence[_Node], size: float, laws: tuple[str, ...]) -> _Explanation | None:
    """The rope's own terms and some others, if they make up the difference."""
    factors: list[Factor] = []
    worst = 0.0
    for node in nodes:
        # Of terms that depend on each other, the first are used: what an explanation adds.
        terms = [*(term for law in laws for term in node.others[law]), *node.own]
        found = projected(node.off, np.stack([term.values.ravel() for term in terms]))
        if found.rest > _EXPLAINED * size:
            return None
        worst = max(worst, found.rest)
        spreads = np.maximum(_SPREAD, _UNCERTAIN * found.spread)
        if np.max(spreads) > _VAGUE:
            # Terms that look alike can make up anything.
            return None
        here = [
            Factor(term.kind, term.place, float(value) + (term.kind not in laws), float(spread))
            for term, value, spread in zip(terms, found.coefficients, spreads, strict=True)
        ]
        if all(each.equals(node.kept) for each in here):
            # The forces are right, and the velocity is multiplied after them.
            here = [each._replace(value=1.0) for each in here]
        factors += here
    own = [each for each in factors if each.kind not in laws]
    faults = _mistakes_in(own)
    for law in laws:
        # Where a spring is never slack, say, the force of slack springs has no coefficient.
        present = [each for each in factors if each.kind == law and each.value]
        if all(each.equals(0.0) for each in present):
            return None
        faults = _with_law(faults, law, present)
    return _Explanation(faults, own, worst, len(laws))


def _with_law(faults: list[Fault], name: str, factors: list[Factor]) -> list[Fault]:
    """Faults, and a force that is no term of a rope.

    Arguments:
        faults: of the rope's own terms.
        name: of the other law.
        factors: its coefficients at all places.
    """
    law = OTHER_LAWS[name]
    remedy = f"leave out the {name.removeprefix('a ')}"
    found = _multiples(factors, not law.of_springs)
    if found is None:
        # Between nodes that no spring joins, each pair has a force of its own.
        return [*faults, Fault(f"there is {name}", name == NOT_JOINED, remedy)]
    words, text = found
    gone = [fault for fault in faults if fault.term == (law.replaces, 0.0)]
    if text + words == law.coefficient and law.words and (gone or not law.replaces):
        # What is left out comes back in another form.
        mended = gone[0].remedy if gone else TERMS["spring"].remedy
        fault = Fault(law.words, remedy=mended, term=(name, 1.0))
        return [fault, *(each for each in faults if each not in gone)]
    text = f"there is {name} (coefficient {text}{words})"
    return [*faults, Fault(text, remedy=remedy)]


def _multiples(factors: list[Factor], in_parts: bool) -> tuple[str, str] | None:
    """Of which number of a node all coefficients are the same multiple, and of which.

    Arguments:
        factors: at all places.
        in_parts: whether a force has several parts, each with a multiple of its own.

    Returns:
        The words for the number, and the multiple, or one for each part in parentheses.
    """
    for words, scale in _SCALES.items():
        parts: dict[int, list[float]] = {}
        for each in factors:
            part = each.place.element if in_parts else 0
            parts.setdefault(part, []).append(each.value / scale(each.place))
        spread = max(each.spread / scale(each.place) for each in factors)
        if all(np.ptp(of) <= 2.0 * spread * (1.0 + abs(of[0])) for of in parts.values()):
            means = [float(np.mean(parts[part])) for part in sorted(parts)]
            if len(means) == 1:
                return words, f"{means[0]:.6g}"
            texts = [f"{0.0 if abs(mean) <= spread else mean:.6g}" for mean in means]
            return words, f"({', '.join(texts)})"
    return None


def _pins(expansions: Sequence[Expansion], words: str, half: int) -> list[Fault]:
    """Whether pinned nodes move, or are accelerated."""
    size = max(float(np.max(np.abs(each.slopes[:, half]))) for each in expansions)
    off = max(
        float(np.max(np.abs(each.rate(0).value[:, half, each.problem.args.free == 0.0])))
        for each in expansions
    )
    return [Fault(words, remedy=_PINS)] if off > _EXPLAINED * size else []


def _unexplained(expansions: Sequence[Expansion], size: float, evidence: dict) -> Fault:
    """Where the acceleration is off, if nobody knows why."""
    off = [np.abs(each.rate(0).value[:, 1]) for each in expansions]
    free = [each[:, e.problem.args.free > 0.0] for each, e in zip(off, expansions, strict=True)]
    evidence["difference"] = max(map(np.max, free)) / size
    return Fault(
        f"the acceleration is off by up to {evidence['difference']:.2g} of its size"
        f"{where_off(expansions, off, _EXPLAINED * size)}, and by no combination of factors on "
        "the rope's own terms",
        named=False,
    )


def _mistakes_in(factors: Sequence[Factor]) -> list[Fault]:
    """What is wrong with the terms of an equation.

    Arguments:
        factors: of all terms, at all nodes of several ropes.
    """
    still = _nodes_that_stand_still(factors)
    held = "is held, though it is free" if len(still) == 1 else "are held, though they are free"
    faults = [Fault(f"{numbered('node', still)} {held}")] if still else []
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
        # It is proportional to the length, less the rest length.
        subject = "the length in the spring force"
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
        return f"in {numbered('spring', springs)}, at {numbered('node', nodes)}"
    return f"at {numbered('node', nodes)}"


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
