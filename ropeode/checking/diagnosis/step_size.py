"""A step that does not use dt as it is given: rounded, cut off, or another one."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import bisect

from ropeode.checking.diagnosis.probe_states import LONGEST, Probe
from ropeode.theory import STEP_LADDER, Diagnosis

# Step sizes, none of them a round number, and by which part of each another one differs that must
# give another state: more than float32's rounding.
_SIZES, _APART = 0.93 * LONGEST * STEP_LADDER, 2.0**-21
# The shortest and longest step that is tried, and how closely an end is found, as a part of it.
_SHORTEST, _LONGEST, _CLOSE = float(_SIZES[-1]) / 2.0, 4.0 * LONGEST, 1e-9
_HALVES = ("positions", "velocities")
_REMEDY = "use dt as it is given: x_new = x + dt * v, v_new = v + dt * a"


class _Plateau(NamedTuple):
    """Step sizes that all give the same state to the last bit, in positions or in velocities.

    Fields:
        low: the shortest; 0 if all that are shorter do.
        high: the longest; infinite if all that are longer do.
        moves: whether the state changes in such a step.
    """

    low: float
    high: float
    moves: bool


def diagnose_step_size(probe: Probe) -> Diagnosis | None:
    """Find intervals of dt in which the step does not depend on it at all.

    They must be the same at all states: rounding of the state itself makes others at each.
    """
    found = {name: _plateaus(probe, half) for half, name in enumerate(_HALVES)}
    those = [name for name, plateaus in found.items() if plateaus]
    if not those:
        return None
    # If both halves have some, they have the same.
    where = f" {those[0]}" if len(those) == 1 else ""
    evidence = {
        name: [{"from": each.low, "to": each.high} for each in plateaus]
        for name, plateaus in found.items()
    }
    line = "; ".join(_in_words(each, where) for each in found[those[0]])
    return Diagnosis("step-size", line, evidence, _REMEDY)


def _states(probe: Probe, sizes: np.ndarray, half: int) -> np.ndarray:
    """Positions or velocities after steps of these sizes, ``(states, sizes, nodes, dim)``."""
    t, y, count = probe.t, probe.y, len(sizes)
    after = probe.after(np.repeat(t, count), np.repeat(y, count, axis=0), np.tile(sizes, len(t)))
    return after.reshape(len(t), count, *y.shape[1:])[:, :, half]


def _plateaus(probe: Probe, half: int) -> list[_Plateau]:
    """The intervals around the longest and the shortest of such `_SIZES`, if all states have them.

    Rounded to multiples, the longest and the shortest step are in different ones; cut off, too.
    """
    after = _states(probe, np.concatenate([_SIZES, _SIZES * (1.0 + _APART)]), half)
    own, longer = np.split(after, 2, axis=1)
    flat = np.flatnonzero(np.all(own == longer, axis=(0, 2, 3)))
    moved = np.any(own != probe.y[:, None, half], axis=(0, 2, 3))
    found: list[_Plateau] = []
    for index in (*flat[:1], *flat[1:][-1:]) if np.any(moved) else ():
        size = float(_SIZES[index])
        if found and found[0].low <= size:
            continue
        low, high = (_end(probe, half, size, last) for last in (_SHORTEST, _LONGEST))
        if low is not None and high is not None:
            found.append(_Plateau(low, high, bool(moved[index])))
    return found


def _end(probe: Probe, half: int, size: float, last: float) -> float | None:
    """The longest or shortest step that is the same as one of a given size; None if states differ.

    It is infinite, or 0, if all are up to the last one that is tried.
    """

    def same(dt: float) -> np.ndarray:
        one, other = np.moveaxis(_states(probe, np.array([size, dt]), half), 1, 0)
        return np.all(one == other, axis=(1, 2))

    if np.all(same(last)):
        return np.inf if last > size else 0.0
    end: Any = bisect(lambda dt: float(same(dt)[0]) - 0.5, size, last, xtol=_CLOSE * size)
    beyond = 10.0 * _CLOSE * float(np.copysign(size, last - size))
    return end if np.all(same(end - beyond)) and not np.any(same(end + beyond)) else None


def _in_words(plateau: _Plateau, where: str) -> str:
    low, high, moves = plateau
    same = f"give the same{where}"
    if low == 0.0 and high == np.inf:
        return f"steps of all lengths {same}, to the last bit, so dt is not used"
    if high == np.inf:
        return f"steps of all lengths above {low:.6g} {same}: there dt is cut off"
    if low == 0.0 and not moves:
        return f"steps of all lengths below {high:.6g} change nothing: there dt is lost"
    if low == 0.0:
        return f"steps of all lengths below {high:.6g} {same}: there dt is made longer"
    return f"steps of all lengths from {low:.6g} to {high:.6g} {same}: dt is rounded"
