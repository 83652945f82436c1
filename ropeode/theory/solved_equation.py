"""The equation that a step solves, where it is not the rope's."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ropeode.theory.diagnosis import Diagnosis
from ropeode.theory.expansion import Expansion
from ropeode.theory.projection import project
from ropeode.theory.rope_terms import (
    NODE_LAWS,
    SPRING_LAWS,
    Motion,
    RopeTerm,
    other_terms,
    own_terms,
)
from ropeode.theory.term_factors import Factor, Fault, mistakes_in

# What may be left over of the difference from the right equation, as a part of the equation.
_EXPLAINED = 1e-6
# How far a coefficient may be off at least, and in units of the vector field's own uncertainty.
_SPREAD, _UNCERTAIN = 1e-8, 1e3


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
    if not (moved or accelerated) or (kept is not None and _is_only_kept(expansions, kept)):
        return None
    if (pace := _pace(expansions)) is not None:
        return pace
    faults, evidence = [], {}
    if moved:
        # Positions that move with the velocity which is kept have no fault of their own.
        by_velocity = _positions(expansions, evidence)
        share = evidence["positions"].get("velocity")
        if (
            kept is None
            or share is None
            or np.max(np.abs(_free(expansions, kept) - share)) > _SPREAD
        ):
            faults += by_velocity
    if accelerated:
        faults += _velocities(expansions, evidence)
    if kept is not None and not all(fault.named for fault in faults):
        # What it loses at each step is mixed with what it adds.
        return None
    texts = [fault.words for fault in faults]
    if not texts:
        off = max(float(np.max(np.abs(each.rate(0).value))) for each in expansions)
        texts = [f"its vector field is off by {off:.1e}"]
    if "rest" in evidence:
        texts[-1] += f" (all else is right to {max(evidence['rest'], 1e-16):.0e})"
    line = "at dt = 0 the step solves another equation: " + "; ".join(texts)
    return Diagnosis("equation", line, evidence)


def _free(expansions: Sequence[Expansion], kept: np.ndarray) -> np.ndarray:
    """What is kept at the free nodes of all ropes."""
    free = [each.problem.args.free > 0.0 for each in expansions]
    return np.concatenate([row[mask] for row, mask in zip(kept, free, strict=True)])


def _is_only_kept(expansions: Sequence[Expansion], kept: np.ndarray) -> bool:
    """Whether what is added to each node is right, or multiplied by what is kept."""
    for each, factors in zip(expansions, kept, strict=True):
        for node in np.flatnonzero(each.problem.args.free):
            for half in (0, 1):
                right, off = each.slopes[:, half, node], each.rate(0).value[:, half, node]
                found = project(off.ravel(), right.ravel()[None])
                lost = 1.0 + float(found.coefficients[0]) - factors[node]
                if found.rest > _EXPLAINED * float(np.max(np.abs(right))) or (
                    min(abs(lost), abs(found.coefficients[0])) > _EXPLAINED
                ):
                    return False
    return True


def _fields(expansion: Expansion) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The right velocities and accelerations, and the differences from them."""
    return expansion.slopes[:, 0], expansion.slopes[:, 1], expansion.rate(0).value


def _pace(expansions: Sequence[Expansion]) -> Diagnosis | None:
    """The same factor on everything: time runs too fast or too slowly."""
    right, off = [], []
    for each in expansions:
        v, a, difference = _fields(each)
        right.append(np.stack([v, a], axis=1).ravel())
        off.append(difference.ravel())
    target = np.concatenate(off)
    found = project(target, np.concatenate(right)[None])
    if found.rest > _EXPLAINED * np.max(np.abs(np.concatenate(right))):
        return None
    pace = 1.0 + float(found.coefficients[0])
    if abs(pace - 1.0) <= _EXPLAINED:
        return None
    if abs(pace) < _EXPLAINED:
        return Diagnosis("equation", _standstill(expansions), {"pace": 0.0})
    return Diagnosis(
        "pace",
        f"time runs {pace:.6g} times as fast as it should: at dt = 0 positions and velocities both "
        f"change at {pace:.6g} times the right rate, as if the weights of the method added up to "
        "this factor, or the step used another dt",
        {"pace": pace, "rest": found.rest},
    )


def _standstill(expansions: Sequence[Expansion]) -> str:
    """In words, that short steps do not move at all; long ones may."""
    moves = any(
        np.any(each.samples.after(each.t, each.y, each.ladder[:, None], 1)[:, 0, 1] != each.y)
        for each in expansions
    )
    if moves:
        return "short steps do not move at all, and long ones do: dt is rounded, or cut off"
    return "the step does not move at all"


def _positions(expansions: Sequence[Expansion], evidence: dict) -> list[Fault]:
    """What the positions change by in place of the velocity."""
    target, fields = [], []
    moved = 0.0
    for each in expansions:
        free = each.problem.args.free > 0.0
        v, a, difference = _fields(each)
        moved = max(moved, float(np.max(np.abs(difference[:, 0, ~free]))))
        target.append(difference[:, 0, free].ravel())
        fields.append([part[:, free].ravel() for part in (v, a, each.y[:, 0])])
    joined = np.concatenate(target)
    found = project(joined, np.concatenate(fields, axis=1))
    size = float(np.max(np.abs(np.concatenate([each[0] for each in fields]))))
    faults = [Fault("pinned nodes move")] if moved > _EXPLAINED * size else []
    if found.rest > _EXPLAINED * size:
        part = float(np.max(np.abs(joined))) / size
        evidence["positions"] = {"difference": part}
        text = f"positions change at another rate than the velocity, by up to {part:.2g} of it"
        return [*faults, Fault(text, named=False)]
    velocity, acceleration, position = map(float, found.coefficients)
    evidence["positions"] = {
        "velocity": 1.0 + velocity,
        "acceleration": acceleration,
        "position": position,
        "rest": found.rest,
    }
    if abs(velocity + 1.0) <= _EXPLAINED:
        faults.append(Fault("positions do not move with the velocity"))
    elif abs(velocity) > _EXPLAINED:
        faults.append(Fault(f"positions move with {1.0 + velocity:.6g} times the velocity"))
    if abs(acceleration) > _EXPLAINED:
        faults.append(
            Fault(
                f"positions change by {acceleration:.6g} dt times the acceleration: dt^2 is right"
            )
        )
    if abs(position) > _EXPLAINED:
        faults.append(Fault(f"positions change by {position:.6g} dt times themselves"))
    return faults


class _Explanation(NamedTuple):
    """A sum of terms that makes up the difference from the right acceleration.

    Fields:
        faults: in words.
        factors: of the rope's own terms.
        rest: what is left over.
    """

    faults: list[Fault]
    factors: list[Factor]
    rest: float

    @property
    def plain(self) -> tuple[int, int]:
        """The simplest explanation has the fewest faults that are not named, then the fewest."""
        return sum(not fault.named for fault in self.faults), len(self.faults)


def _velocities(expansions: Sequence[Expansion], evidence: dict) -> list[Fault]:
    """Which terms of the acceleration are off by which factors, or what else is in it."""
    size = max(float(np.max(np.abs(each.slopes[:, 1]))) for each in expansions)
    faults = _pins(expansions, size)
    laws = (*NODE_LAWS, *SPRING_LAWS)
    found: list[_Explanation] = []
    for several in range(3):
        tried = (
            _explanation(expansions, size, law) for law in itertools.combinations(laws, several)
        )
        found += [each for each in tried if each is not None]
        # Two at once explain much: only where nothing simpler does.
        if found and several:
            break
    if not found:
        return [*faults, _unexplained(expansions, size, evidence)]
    best = min(found, key=lambda each: each.plain)
    evidence["factors"] = {
        kind: sorted({float(f"{each.value:.6g}") for each in best.factors if each.kind == kind})
        for kind in dict.fromkeys(each.kind for each in best.factors)
    }
    evidence["rest"] = best.rest / size
    return faults + _with_mean_velocity(expansions, best.faults)


def _with_mean_velocity(expansions: Sequence[Expansion], faults: list[Fault]) -> list[Fault]:
    """Where half the acceleration is lost because a velocity is a difference of positions."""
    if [fault.words for fault in faults] != ["the acceleration is counted half"]:
        return faults
    for each in expansions:
        dt = each.ladder / 8.0
        after = each.samples.after(each.t, each.y, dt[:, None], 1)[:, 0, 1]
        mean = (after[:, 0] - each.y[:, 0]) / dt[:, None, None]
        if np.max(np.abs(mean - after[:, 1])) > _EXPLAINED * np.max(np.abs(mean)):
            return faults
    return [
        Fault(
            "the acceleration is counted half in the velocity, which is (x_new - x)/dt: that is "
            "the mean velocity of the step, and contains dt/2 a; add the other dt/2 a"
        )
    ]


def _explanation(
    expansions: Sequence[Expansion], size: float, laws: tuple[str, ...]
) -> _Explanation | None:
    """The rope's own terms and some others, if they make up the difference."""
    terms: list[tuple[RopeTerm, float]] = []
    worst = 0.0
    for each, node in _free_nodes(expansions):
        group, rest = _node(each, node, laws)
        if rest > _EXPLAINED * size:
            return None
        terms, worst = terms + group, max(worst, rest)
    spread = _spread(expansions, size)
    factors = [
        Factor(term.kind, term.place, 1.0 + value, spread)
        for term, value in terms
        if term.kind not in laws
    ]
    faults = mistakes_in(factors)
    for law in laws:
        values = [value for term, value in terms if term.kind == law and value]
        faults.append(_law(law, values, spread))
    return _Explanation(_merged(faults), factors, worst)


def _spread(expansions: Sequence[Expansion], size: float) -> float:
    """How far a coefficient may be off."""
    error = max(float(np.median(each.rate(0).error[1])) for each in expansions)
    return max(_SPREAD, _UNCERTAIN * error / size)


def _law(law: str, values: list[float], spread: float) -> Fault:
    if values and np.ptp(values) <= spread * (1.0 + abs(values[0])):
        if abs(values[0] + 1.0) <= spread:
            return Fault(f"{law} is left out")
        return Fault(f"there is {law} (coefficient {values[0]:.6g})")
    return Fault(f"there is {law}", named=False)


def _merged(faults: list[Fault]) -> list[Fault]:
    """A term that is left out, and comes back with another direction, as one fault."""
    words = [fault.words for fault in faults]
    for subject in ("rest length", "spring force"):
        gone, start = f"the {subject} is left out", f"there is a {subject} whose "
        back = [each for each in words if each.startswith(start) and each.endswith("ient 1)")]
        if gone in words and back:
            text = back[0].removeprefix(start).removesuffix(" (coefficient 1)")
            rest = [fault for fault in faults if fault.words not in (gone, back[0])]
            return [Fault(f"the {subject}'s {text}"), *rest]
    return faults


def _pins(expansions: Sequence[Expansion], size: float) -> list[Fault]:
    """Whether nodes move that are pinned."""
    off = max(
        float(np.max(np.abs(each.rate(0).value[:, 1, each.problem.args.free == 0.0])))
        for each in expansions
    )
    return [Fault("pinned nodes are accelerated")] if off > _EXPLAINED * size else []


def _free_nodes(expansions: Sequence[Expansion]) -> list[tuple[Expansion, int]]:
    return [
        (each, int(node)) for each in expansions for node in np.flatnonzero(each.problem.args.free)
    ]


def _node(
    expansion: Expansion, node: int, laws: Sequence[str]
) -> tuple[list[tuple[RopeTerm, float]], float]:
    """The coefficients of the difference in one node's acceleration, and what is left over."""
    motion, difference = _motion(expansion), expansion.rate(0).value[:, 1, node]
    # Of terms that depend on each other, the first are used: what an explanation adds.
    terms = [term for law in laws for term in other_terms(motion, node, law)]
    terms += own_terms(motion, node)
    found = project(difference.ravel(), np.stack([term.values.ravel() for term in terms]))
    return list(zip(terms, map(float, found.coefficients), strict=True)), found.rest


def _motion(expansion: Expansion) -> Motion:
    """The states of an expansion."""
    x, v = expansion.y[:, 0], expansion.y[:, 1]
    return Motion(expansion.problem.args, expansion.t, x, v)


def _unexplained(expansions: Sequence[Expansion], size: float, evidence: dict) -> Fault:
    """Where the acceleration is off, if nobody knows why."""
    off = [
        (node, float(np.max(np.abs(each.rate(0).value[:, 1, node]))))
        for each, node in _free_nodes(expansions)
    ]
    largest = max(value for _, value in off) / size
    nodes = sorted({node for node, value in off if value > _EXPLAINED * size})
    evidence["difference"] = largest
    evidence["nodes"] = nodes
    every = {node for node, _ in off}
    where = "" if {*nodes} == every else f", at node {', '.join(map(str, nodes))} alone"
    return Fault(
        f"the acceleration is off by up to {largest:.2g} of its size{where}, and by no combination "
        "of factors on the rope's own terms",
        named=False,
    )
