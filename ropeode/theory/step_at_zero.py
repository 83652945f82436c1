"""What a step makes of a state, as multiples of the positions, velocities and accelerations."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ropeode.theory.diagnosis import Diagnosis, Fault
from ropeode.theory.expansion import Expansion
from ropeode.theory.projection import projected
from ropeode.theory.terms import AXES, TERMS
from ropeode.theory.whereabouts import where_off

# What may be left over, as a part of the state, and how close two numbers must be.
_EXPLAINED, _CLOSE = 1e-6, 1e-6
# In units of its estimated error, what a term may be that is zero.
_UNCERTAIN = 10.0
# The shortest step, as a part of the longest; by how much of its size it may move a state, and what
# it may add beside that.
_SHORTEST, _MOVES, _BESIDE = 2.0**-14, 2e-3, 2e-4
_UNCHANGED = "x_new = x + dt * (...), v_new = v + dt * (...): both must be as they were if dt is 0"
_POSITIONS = "x_new = x + dt * v + dt**2 / 2 * a"
# More states than these have a number in common not by chance.
_SOME = 3
_NO_LIMIT = "so the runs have no limit as dt goes to 0"
_QUANTITIES, _FIELDS = ("positions", "velocities"), ("position", "velocity", "acceleration")


# Multiples of a node's own motion in the state after a step, as dt goes to 0: at (quantity, field)
# the words that say which one is there; and those that say that there is none, where one should be.
_AT_ZERO = {
    (0, 0): ("positions are multiplied by {}", "the new positions do not contain the old ones"),
    (0, 1): ("positions move by {} times the velocity, without dt", ""),
    (1, 0): ("velocities change by {} times the positions, without dt", ""),
    (0, 2): ("positions change by {} times the acceleration, without dt", ""),
    (1, 2): ("velocities change by {} times the acceleration, without dt", ""),
    (1, 1): (
        "each step multiplies velocities by {}",
        "the new velocities do not contain the old ones",
    ),
}
_SWAPPED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])[:, :, None]
# Such multiples in the rate at which positions change.
_RATES = {
    (0, 1): (
        "positions move with {} times the velocity",
        "positions do not move with the velocity",
    ),
    (0, 2): ("positions change by {} dt times the acceleration", ""),
    (0, 0): ("positions change by {} dt times themselves", ""),
}


class _Added(NamedTuple):
    """What a step adds to the states of a rope, or to them per unit of time.

    Fields:
        expansion: of the step.
        before: the states, ``(states, 2, nodes, dim)``.
        added: to them.
    """

    expansion: Expansion
    before: np.ndarray
    added: np.ndarray


def diagnose_identity(expansions: Sequence[Expansion]) -> Diagnosis | None:
    """What a step adds to positions and velocities at dt = 0; None if it adds nothing."""
    terms = [each.at_zero() for each in expansions]
    if not any(np.any(change.known) for _, change in terms):
        return _shortest_step(expansions)
    found = [
        _Added(each, base, change.value)
        for each, (base, change) in zip(expansions, terms, strict=True)
    ]
    change = np.concatenate([each.added for each in found])
    size = max(float(np.max(np.abs(each.y))) for each in expansions)
    evidence: dict = {"size": float(np.max(np.abs(change))) / size}
    if _puts_to_rest_lengths(expansions):
        return Diagnosis(
            "constraint",
            "each step puts springs back to their rest lengths, however short it is: this is a "
            "constraint (a rigid link), and not a spring",
            evidence,
            "let the stretch make a force, stiffness * (length - rest_length), and no displacement",
        )
    errors = np.max([np.max(change.error, axis=1) for _, change in terms], axis=0)
    of_x, of_v = (_shares(found, half, _UNCERTAIN * errors[half]) for half in (0, 1))
    if of_x is None or of_v is None:
        after = [_shortest(each) for each in expansions]
        beside = [*map(_beside_motion, expansions, after)]
        off = [np.max(each, axis=1) for each in beside]
        where = where_off(expansions, off, _BESIDE * size)
        where += _becomes(expansions, after, beside, _BESIDE * size)
        line = f"at dt = 0 the step changes the state by up to {evidence['size']:.2g} of its size"
        return Diagnosis("identity", f"{line}{where}, {_NO_LIMIT}", evidence, _UNCHANGED)
    parts = np.stack([of_x, of_v]) + np.eye(2, 3)[:, :, None]
    evidence |= dict(zip(_QUANTITIES, map(_means, parts), strict=True))
    if _same(parts, _SWAPPED):
        line = "the step returns the velocities first"
        return Diagnosis("swapped", line, evidence, "return positions, then velocities")
    line, factors = f"at dt = 0 {'; '.join(_told(_AT_ZERO, parts))}", parts[1, 1]
    if not _same(parts[:, 2], 0.0) or _same(factors, 0.0) or _same(factors, 1.0):
        return Diagnosis("identity", line, evidence, _UNCHANGED)
    evidence["lost_per_step"] = 1.0 - float(np.mean(factors))
    free = np.stack([each.problem.args.free > 0.0 for each in expansions])
    kept = np.ones(free.shape)
    kept[free] = factors
    evidence["kept"] = kept.tolist()
    line += f"{_as_damping(expansions, free, 1.0 - factors)}, whatever dt is, {_NO_LIMIT}"
    return Diagnosis("damping-per-step", line, evidence, TERMS["kept"].remedy)


def _as_damping(expansions: Sequence[Expansion], free: np.ndarray, lost: np.ndarray) -> str:
    """Which multiple of the damping velocities lose, in words; empty if they lose another part."""
    damping, mass = (
        np.stack([getattr(each.problem.args, name) for each in expansions])[free]
        for name in ("damping", "mass")
    )
    for words, rate in (("damping", damping), ("damping / mass", damping / mass)):
        # Of one rope alone a factor says nothing of what it depends on.
        if len(expansions) > 1 and np.all(rate):
            part = float(np.mean(lost / rate))
            if _same(lost / rate, part):
                return f", 1 - {'' if _same(np.array(part), 1.0) else f'{part:.6g} '}{words}"
    return ""


def position_faults(
    expansions: Sequence[Expansion], kept: np.ndarray | None, evidence: dict
) -> list[Fault]:
    """What positions change by in place of the velocity.

    Arguments:
        expansions: of the step.
        kept: by which factor the velocity of each node is multiplied first, ``(ropes, nodes)``; it
            may be that velocity.
        evidence: for the numbers.
    """
    found = [_Added(each, each.y, each.rate(0).value) for each in expansions]
    size = max(float(np.max(np.abs(each.y[:, 1]))) for each in expansions)
    own = _shares(found, 0, _EXPLAINED * size)
    if own is None:
        off = [each.added[:, 0, each.expansion.problem.args.free > 0.0] for each in found]
        part = max(float(np.max(np.abs(each))) for each in off) / size
        evidence["positions"] = {"difference": part}
        text = f"positions change at another rate than the velocity, by up to {part:.2g} of it"
        return [Fault(text, named=False, remedy=_POSITIONS)]
    parts = own[None] + np.eye(1, 3, 1)[:, :, None]
    evidence["positions"] = _means(parts[0])
    if kept is not None:
        free = np.stack([each.problem.args.free > 0.0 for each in expansions])
        if _same(parts[0, 1], kept[free]):
            parts[0, 1] = 1.0
    return [Fault(text, remedy=_POSITIONS) for text in _told(_RATES, parts)]


def _shares(found: Sequence[_Added], half: int, close: float) -> np.ndarray | None:
    """Which multiples of its own motion make up what is added to each free node.

    Arguments:
        found: on several ropes.
        half: 0 for what is added to positions, 1 for velocities.
        close: how much may be left over at least.

    Returns:
        ``(fields, free nodes of all ropes)``; None if something else is added.
    """
    parts = []
    for each, before, added in found:
        motion = np.stack([before[:, 0], before[:, 1], each.slopes[:, 1]])
        for node in np.flatnonzero(each.problem.args.free):
            moved = added[:, half, node].ravel()
            own = projected(moved, motion[:, :, node].reshape(len(motion), -1))
            if own.rest > max(_EXPLAINED * np.max(np.abs(moved)), close):
                return None
            parts.append(own.coefficients)
    return np.stack(parts, axis=1)


def _shortest(expansion: Expansion) -> np.ndarray:
    """The states after the shortest step, ``(states, *state)``."""
    dt = expansion.ladder[:, None] * _SHORTEST
    return expansion.samples.after(expansion.t, expansion.y, dt, 1)[:, 0, 1]


def _beside_motion(expansion: Expansion, after: np.ndarray) -> np.ndarray:
    """How much the shortest step adds to the states beside their motion, ``(states, *state)``."""
    dt = expansion.ladder.reshape(-1, 1, 1, 1) * _SHORTEST
    return np.abs(after - expansion.y - dt * expansion.slopes)


def _becomes(
    expansions: Sequence[Expansion],
    after: Sequence[np.ndarray],
    beside: Sequence[np.ndarray],
    least: float,
) -> str:
    """A clause: which number all states have in common after a step that changes them.

    So they have at a limit, on a floor, or at rest.

    Arguments:
        expansions: of the step.
        after: the states after the shortest step, for each.
        beside: how much that adds beside the motion.
        least: what is a change.
    """
    pairs = [
        np.stack([states, added > least])[..., each.problem.args.free > 0.0, :]
        for each, states, added in zip(expansions, after, beside, strict=True)
    ]
    (x, v), (x_off, v_off) = np.moveaxis(np.concatenate(pairs, axis=1), 2, 1)
    numbers = {
        **{
            f"the node's {AXES[i]} becomes {{}}": (x[..., i], x_off[..., i])
            for i in range(x.shape[-1])
        },
        "the node's speed becomes {}": (np.linalg.norm(v, axis=-1), np.any(v_off, axis=-1)),
        "components of the velocity become {0} or -{0}": (np.abs(v), v_off),
    }
    for words, (after, off) in numbers.items():
        values = after[off > 0]
        if len(values) >= _SOME and np.ptp(values) <= least:
            return f"; there {words.format(f'{np.median(values):.3g}')}"
    return ""


def _puts_to_rest_lengths(expansions: Sequence[Expansion]) -> bool:
    """Whether a spring has its rest length after the shortest step, at all states."""
    off = []
    for each in expansions:
        length = np.linalg.norm(np.diff(_shortest(each)[:, 0], axis=1), axis=2)
        off.append(np.max(np.abs(length / each.problem.args.rest_length - 1.0), axis=0))
    return bool(np.min(np.max(off, axis=0)) <= _SHORTEST)


def _shortest_step(expansions: Sequence[Expansion]) -> Diagnosis | None:
    """What a very short step does, where many of them have no expansion in powers of dt."""
    size = max(float(np.max(np.abs(each.y))) for each in expansions)
    change = max(float(np.max(np.abs(_shortest(each) - each.y))) for each in expansions)
    if change <= _MOVES * size:
        return None
    if not np.isfinite(change):
        line = "the shortest steps from moving states give numbers that are not finite"
        return Diagnosis("identity", line, {"part": _SHORTEST})
    if change > size / _MOVES:
        line = (
            "the shorter a step is, the more it changes the state: something is divided by dt that "
            "does not go to 0 with dt"
        )
    else:
        line = (
            f"the shortest steps change the state by {change / size:.2g} of its size, {_NO_LIMIT}"
        )
    return Diagnosis("identity", line, {"size": change / size, "part": _SHORTEST})


def _told(rows: dict[tuple[int, int], tuple[str, str]], parts: np.ndarray) -> list[str]:
    """In words, which multiples are not the right ones.

    Arguments:
        rows: that say what is right.
        parts: the multiples, ``(quantities, fields, free nodes of all ropes)``.
    """
    texts = []
    for place, (words, none) in rows.items():
        if not _same(parts[place], 1.0 if none else 0.0):
            missing = none and _same(parts[place], 0.0)
            texts.append(none if missing else words.format(_range(parts[place])))
    return texts


def _means(parts: np.ndarray) -> dict[str, float]:
    return dict(zip(_FIELDS, np.mean(parts, axis=1).tolist(), strict=True))


def _same(values: np.ndarray, others: Any) -> bool:
    return bool(np.all(np.abs(values - others) <= _CLOSE * (1.0 + np.abs(others))))


def _range(values: np.ndarray) -> str:
    if (spread := np.ptp(values)) <= _CLOSE:
        return f"{np.mean(values):.{int(-np.log10(max(spread, 1e-10)))}g}"
    return f"{np.min(values):.6g} to {np.max(values):.6g}"
