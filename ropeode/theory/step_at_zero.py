"""What a step does at dt = 0, where it should do nothing."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ropeode.theory.diagnosis import Diagnosis
from ropeode.theory.expansion import Expansion, Term
from ropeode.theory.projection import projected
from ropeode.theory.terms import TERMS, along_axes

# What may be left over, as a part of the state, and how close two numbers must be.
_EXPLAINED, _CLOSE = 1e-6, 1e-6
# In units of its estimated error, what a term may be that is zero.
_UNCERTAIN = 10.0
# How many numbers must be at a limit.
_SOME = 3
# The shortest step, as a part of the longest, and by how much of its size it may move a state.
_SHORTEST, _MOVES = 2.0**-14, 2e-3
_UNCHANGED = "x_new = x + dt * (...), v_new = v + dt * (...): both must be as they were if dt is 0"
_NO_LIMIT = "so the runs have no limit as dt goes to 0"


def diagnose_identity(expansions: Sequence[Expansion]) -> Diagnosis | None:
    """What a step adds to positions and velocities at dt = 0; None if it adds nothing."""
    found = [each.at_zero() for each in expansions]
    if not any(np.any(change.known) for _, change in found):
        return _shortest_step(expansions)
    change = [each.value for _, each in found]
    size = max(float(np.max(np.abs(each.y))) for each in expansions)
    evidence: dict = {"size": max(float(np.max(np.abs(each))) for each in change) / size}
    of_x, of_v = (_coefficients(expansions, found, half) for half in (0, 1))
    if _puts_to_rest_lengths(expansions):
        return Diagnosis(
            "constraint",
            "each step puts springs back to their rest lengths, however short it is: this is a "
            "constraint (a rigid link), and not a spring",
            evidence,
            "let the stretch make a force, stiffness * (length - rest_length), and no displacement",
        )
    if of_x is None or of_v is None:
        if named := _limited(expansions) or _averaged(expansions):
            line = f"at dt = 0 the step changes the state: {named}, {_NO_LIMIT}"
            return Diagnosis("identity", line, evidence, _UNCHANGED)
        changed = np.max([np.max(np.abs(each), axis=(0, 1, 2)) for each in change], axis=0)
        line = f"at dt = 0 the step changes the state by up to {evidence['size']:.2g} of its size"
        line += along_axes(changed > _EXPLAINED * size)
        return Diagnosis("identity", f"{line}, {_NO_LIMIT}", evidence, _UNCHANGED)
    (xx, xv, xa), (vx, vv, va) = of_x, of_v
    evidence |= {
        "positions": {"times_position": _mean(xx), "times_velocity": _mean(xv)},
        "velocities": {"times_position": _mean(vx), "times_velocity": _mean(vv)},
    }
    if _all(xx, -1.0) and _all(xv, 1.0) and _all(vx, 1.0) and _all(vv, -1.0):
        line = "the step returns the velocities first"
        return Diagnosis("swapped", line, evidence, "return positions, then velocities")
    texts = []
    if _all(xx, -1.0):
        texts.append("the new positions do not contain the old ones")
    elif not _all(xx, 0.0):
        texts.append(f"positions are multiplied by {_factor(xx)}")
    if not _all(xv, 0.0):
        texts.append(f"positions move by {_range(xv)} times the velocity, without dt")
    if _all(vv, -1.0):
        texts.append("the new velocities do not contain the old ones")
    if not _all(vx, 0.0):
        texts.append(f"velocities change by {_range(vx)} times the positions, without dt")
    without_dt = [
        f"{quantity} change by {_range(share)} times the acceleration, without dt"
        for quantity, share in (("positions", xa), ("velocities", va))
        if not _all(share, 0.0)
    ]
    texts += without_dt
    if without_dt or _all(vv, -1.0) or _all(vv, 0.0):
        line = f"at dt = 0 {'; '.join(texts)}"
        return Diagnosis("identity", line, evidence, _UNCHANGED)
    free = np.stack([each.problem.args.free > 0.0 for each in expansions])
    damping, masses = (
        np.stack([getattr(each.problem.args, name) for each in expansions])[free]
        for name in ("damping", "mass")
    )
    share = ""
    for words, rate in (("damping", damping), ("damping / mass", damping / masses)):
        # Of one rope alone a factor says nothing of what it depends on.
        if len(expansions) == 1 or not np.all(rate):
            continue
        part = -_mean(vv / rate)
        if _all(vv / rate, -part):
            share = f", 1 - {'' if _all(np.array([part]), 1.0) else f'{part:.6g} '}{words}"
    texts.append(
        f"each step multiplies velocities by {_factor(vv)}{share}, whatever dt is, {_NO_LIMIT}"
    )
    evidence["lost_per_step"] = -_mean(vv)
    kept = np.ones(free.shape)
    kept[free] = 1.0 + vv
    evidence["kept"] = kept.tolist()
    line = f"at dt = 0 {'; '.join(texts)}"
    return Diagnosis("damping-per-step", line, evidence, TERMS["kept"].remedy)


def _shortest(expansion: Expansion) -> np.ndarray:
    """The states after the shortest step, ``(states, *state)``."""
    dt = expansion.ladder[:, None] * _SHORTEST
    return expansion.samples.after(expansion.t, expansion.y, dt, 1)[:, 0, 1]


def _limited(expansions: Sequence[Expansion]) -> str | None:
    """Which number all that changes is set to, if it is one: a limit, a floor, rest."""
    before, after = (
        np.concatenate([states[:, :, each.problem.args.free > 0.0] for each, states in pairs])
        for pairs in (
            [(each, each.y) for each in expansions],
            [(each, _shortest(each)) for each in expansions],
        )
    )
    near = _MOVES * float(np.max(np.abs(before)))
    moved = np.abs(after - before) > near
    speeds = [np.linalg.norm(states[:, 1], axis=-1) for states in (before, after)]
    limited = {
        **{
            f"{axis} of the nodes": (before[:, 0, :, i], after[:, 0, :, i], moved[:, 0, :, i])
            for i, axis in enumerate("xyz"[: before.shape[3]])
        },
        "each component of the velocity": (
            *(np.abs(states[:, 1]) for states in (before, after)),
            moved[:, 1],
        ),
        "the speed": (*speeds, np.abs(speeds[1] - speeds[0]) > near),
    }
    texts = []
    for name, (old, new, changed) in limited.items():
        if np.sum(changed) < _SOME or np.all(changed):
            continue
        value = float(np.median(new[changed]))
        rest = old[~changed]
        if np.max(np.abs(new[changed] - value)) > near:
            continue
        if np.all(old[changed] > value) and np.all(rest <= value + 2.0 * near):
            texts.append(f"{name} is at most {value:.3g}")
        elif np.all(old[changed] < value) and np.all(rest >= value - 2.0 * near):
            texts.append(f"{name} is at least {value:.3g}")
    if not texts:
        return None
    # A speed is limited as well where each component is.
    return " and ".join(
        texts[:-1] if len(texts) > 1 and texts[-1].startswith("the speed") else texts
    )


def _averaged(expansions: Sequence[Expansion]) -> str | None:
    """Whether velocities, and nothing else, become sums of those of several nodes."""
    most: dict[int, float] = {}
    of = 0
    for each in expansions:
        base, change = each.at_zero()
        v, off = base[:, 1], change.value
        size = float(np.max(np.abs(v)))
        if np.max(np.abs(off[:, 0])) > _EXPLAINED * size:
            return None
        fields = np.moveaxis(v, 1, 0).reshape(v.shape[1], -1)
        for node in np.flatnonzero(each.problem.args.free):
            found = projected(off[:, 1, node].ravel(), fields)
            if found.rest > _EXPLAINED * size:
                return None
            shares = {i: float(c) + (i == node) for i, c in enumerate(found.coefficients)}
            shares = {i: share for i, share in shares.items() if abs(share) > _EXPLAINED}
            if len(shares) > max(1, len(most)):
                most, of = shares, int(node)
    if not most:
        return None
    words = " + ".join(f"{share:.6g} v{i}" for i, share in sorted(most.items()))
    return f"velocities are mixed with those of other nodes (v{of} becomes {words})"


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


def _coefficients(
    expansions: Sequence[Expansion], found: Sequence[tuple[np.ndarray, Term]], half: int
) -> np.ndarray | None:
    """By which parts of its position, velocity and acceleration each free node changes.

    Arguments:
        expansions: of the step.
        found: the states of each at dt = 0, and how the step changes them.
        half: 0 for the change of positions, 1 for that of velocities.

    Returns:
        ``(3, free nodes of all ropes)``; None if one changes by something else.
    """
    parts = []
    for each, (base, change) in zip(expansions, found, strict=True):
        for node in np.flatnonzero(each.problem.args.free):
            moved = change.value[:, half, node]
            fields = [base[:, 0, node], base[:, 1, node], each.slopes[:, 1, node]]
            own = projected(moved.ravel(), np.stack([field.ravel() for field in fields]))
            least = _EXPLAINED * max(np.max(np.abs(moved)), _EXPLAINED * np.max(np.abs(fields[1])))
            if own.rest > max(least, _UNCERTAIN * float(np.max(change.error[half]))):
                return None
            parts.append(own.coefficients)
    return np.stack(parts, axis=1)


def _all(values: np.ndarray, value: float) -> bool:
    return bool(np.all(np.abs(values - value) <= _CLOSE * (1.0 + abs(value))))


def _mean(values: np.ndarray) -> float:
    return float(np.mean(values))


def _factor(change: np.ndarray) -> str:
    return _range(1.0 + change)


def _range(values: np.ndarray) -> str:
    if (spread := np.ptp(values)) <= _CLOSE:
        return f"{_mean(values):.{int(-np.log10(max(spread, 1e-10)))}g}"
    return f"{np.min(values):.6g} to {np.max(values):.6g}"
