"""A step that does not use dt as it is given: rounded, cut off, or another one."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ropeode.checking.diagnosis.probe_states import LONGEST, Probe
from ropeode.theory import STEP_LADDER, Diagnosis

# Step sizes, none of them a round number, and by which part of each another one differs that must
# give another state: more than float32's rounding.
_SIZES, _APART = 0.93 * LONGEST * STEP_LADDER, 2.0**-21
# How often the distance to the end of an interval is doubled and then halved, and how closely the
# ends are then the same.
_DOUBLINGS, _HALVINGS, _SAME = 40, 26, 1e-6
# The shortest and longest step that is tried, and of how many intervals the ends are found.
_SHORTEST, _LONGEST, _FEW = float(_SIZES[-1]) / 2.0, 4.0 * LONGEST, 3
_ALL = slice(None)
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
    flat = np.all(_same(probe, _SIZES, _SIZES * (1.0 + _APART)), axis=1)
    if not np.any(flat):
        return None
    moved = np.any(_states(probe, _SIZES) != probe.y[:, None], axis=(3, 4))
    found = [_plateaus(probe, half, flat[half], moved[:, :, half]) for half in range(2)]
    if not any(found):
        return None
    # If both halves have some, they have the same.
    where = "" if all(found) else f" {_HALVES[0] if found[0] else _HALVES[1]}"
    evidence = {
        name: [{"from": each.low, "to": each.high} for each in plateaus]
        for name, plateaus in zip(_HALVES, found, strict=True)
    }
    line = _in_words(found[0] or found[1], where)
    return Diagnosis("step-size", line, evidence, _REMEDY)


def _states(probe: Probe, sizes: np.ndarray, some: slice = _ALL) -> np.ndarray:
    """After steps of these sizes from some of the states, ``(states, sizes, *state)``."""
    t, y, count = probe.t[some], probe.y[some], len(sizes)
    after = probe.after(np.repeat(t, count), np.repeat(y, count, axis=0), np.tile(sizes, len(t)))
    return after.reshape(len(t), count, *y.shape[1:])


def _same(probe: Probe, one: np.ndarray, other: np.ndarray, some: slice = _ALL) -> np.ndarray:
    """Whether two step sizes each give the same to the last bit, ``(2, states, sizes)``."""
    both = _states(probe, np.concatenate([one, other]), some)
    first, second = np.split(both, 2, axis=1)
    return np.moveaxis(np.all(first == second, axis=(3, 4)), 2, 0)


def _plateaus(probe: Probe, half: int, flat: np.ndarray, moved: np.ndarray) -> list[_Plateau]:
    """The intervals around some of `_SIZES`, if they are the same at all states.

    Arguments:
        flat: at which of the sizes a step is the same as a little longer one, ``(sizes,)``.
        moved: whether it changes the state at all, ``(states, sizes)``.
    """
    every = np.flatnonzero(flat) if np.any(moved) else []
    found: list[_Plateau] = []
    for index in dict.fromkeys((*every[:_FEW], *every[-1:])):
        size = float(_SIZES[index])
        if found and found[-1].low <= size:
            continue
        low, high = (_end(probe, half, size, up) for up in (False, True))
        if low is not None and high is not None:
            found.append(_Plateau(low, high, bool(np.any(moved[:, index]))))
    return found


def _end(probe: Probe, half: int, size: float, up: bool) -> float | None:
    """The longest or shortest step that is the same as one of a given size; None if states differ.

    It is infinite, or 0, if all are.
    """

    def same(sizes: np.ndarray, some: slice = slice(1)) -> np.ndarray:
        return _same(probe, sizes, np.full(len(sizes), size), some)[half]

    factors = 1.0 + _APART * 2.0 ** np.arange(_DOUBLINGS)
    tried = size * factors if up else size / factors
    tried = tried[(tried >= _SHORTEST) & (tried <= _LONGEST)]
    close = same(tried)[0]
    if np.all(close):
        return np.inf if up else 0.0
    first = int(np.argmin(close))
    inside, outside = float(tried[first - 1]) if first else size, float(tried[first])
    for _ in range(_HALVINGS):
        middle = (inside + outside) / 2.0
        inside, outside = (middle, outside) if same(np.array([middle]))[0, 0] else (inside, middle)
    sharp = same(np.array([inside, outside]), _ALL)
    return inside if np.all(sharp[:, 0]) and not np.any(sharp[:, 1]) else None


def _in_words(found: list[_Plateau], where: str) -> str:
    longest = found[0]
    if longest.low == 0.0 and longest.high == np.inf:
        return f"steps of all lengths give the same{where}, to the last bit, so dt is not used"
    between = [each for each in found if each.low > 0.0 and each.high < np.inf]
    shortest = found[-1]
    if between:
        low, high, _ = between[0]
        same = f"steps of {low:.6g} and of {high:.6g} give the same{where}, to the last bit"
        return f"{same}: {_multiple(between, shortest)}"
    texts = []
    if longest.high == np.inf:
        texts.append(f"above {longest.low:.6g} give the same{where}: there dt is cut off")
    if shortest.low == 0.0 and shortest.moves:
        texts.append(f"below {shortest.high:.6g} give the same{where}: there dt is made longer")
    elif shortest.low == 0.0:
        texts.append(f"below {shortest.high:.6g} change nothing: there dt is lost")
    return "; ".join(f"steps of all lengths {text}" for text in texts)


def _multiple(between: list[_Plateau], shortest: _Plateau) -> str:
    """To which numbers dt is rounded."""
    units = np.array([each.high - each.low for each in between])
    unit = float(units[0])
    low = np.array([each.low for each in between]) / unit
    off = np.max(np.abs(2.0 * low - np.round(2.0 * low)))
    halves = np.unique(np.round(2.0 * low) % 2.0)
    if np.ptp(units) > _SAME * between[0].high or off > _SAME * np.max(low) or len(halves) > 1:
        return "dt is rounded"
    if halves[0]:
        return f"dt is rounded to the nearest multiple of {unit:.6g}"
    up = shortest.low == 0.0 and shortest.moves
    way, last = ("up", "of which the last is too long") if up else ("down", "that leave out a rest")
    return f"dt is rounded {way} to a multiple of {unit:.6g}, as by sub-steps of this length {last}"
