"""The solution along a reference, cut into pieces in which it is smooth: where steps are made."""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np

from ropeode.references import Reference
from ropeode.theory.flow import Flow, largest, short_flow
from ropeode.theory.step_samples import rates_of

# States at which a piece is looked at; pieces may be so many; states that are taken at once.
_PLACES, _MOST_PIECES, _AT_ONCE = 6, 3000, 512
# The states lie in the first half of the time over which the flow is known: from each of them it
# is known for the other half.
_FRACTIONS = np.arange(_PLACES + 1) / (2 * _PLACES)

# The disturbance of time, in units of its last place, that shows a jump, and how large that is.
_DISTURBANCE, _JUMP = 64.0, 1e-6


class Pieces(NamedTuple):
    """States of a solution, and the solution from each of them on.

    Fields:
        t: times, ``(states,)``.
        y: states, ``(states, *state)``.
        reach: how long the solution from each is known, ``(states,)``.
        flow: the solutions that the states lie on, at `_FRACTIONS` of their lengths.
    """

    t: np.ndarray
    y: np.ndarray
    reach: np.ndarray
    flow: Flow

    def increments(self, fractions: np.ndarray) -> np.ndarray:
        """How far the solution moves in fractions of `reach`, ``(states, fractions, *state)``."""
        begin = self.flow.increments(_FRACTIONS)
        ends = (_FRACTIONS[:, None] + fractions / 2.0).ravel()
        ahead = self.flow.increments(ends).reshape(*begin.shape[:2], -1, *begin.shape[2:])
        return (ahead - begin[:, :, None]).reshape(len(self.t), -1, *begin.shape[2:])


@functools.lru_cache(maxsize=4)
def solution_along(reference: Reference) -> tuple[list[Pieces], np.ndarray] | str:
    """The solution of a reference between its samples, to rounding, as far as it is trusted.

    Arguments:
        reference: whose solution.

    Returns:
        Pieces, and the index of the states of all of them, one after the other, in the order of
        time. A reason in place of them where it is smooth in very short pieces only.
    """
    times, states = reference.times[: reference.trusted], reference.states[: reference.trusted]
    rates, found, count = rates_of(reference.problem), [], 0
    # All frames are begun at once, and each is followed to its end.
    t, y, left = times[:-1], states[:-1], np.diff(times)
    length = 2.0 * left
    # Where a frame ends no piece shows it.
    late = _DISTURBANCE * np.spacing(np.max(np.abs(times)))
    before, after = (rates(times + way * late, states) for way in (-1.0, 1.0))
    jump = largest(after - before)[1:-1] > _JUMP * np.max(np.abs(after), initial=0.0)
    if np.any(jump):
        return f"the right-hand side jumps at t = {times[1:-1][jump][0]:.6g}"

    while len(t):
        flow = short_flow(rates, t, y, np.minimum(2.0 * left, 2.0 * length))
        length, moved = flow.length, flow.increments(_FRACTIONS)
        with np.errstate(invalid="ignore"):
            needed = count + np.sum(np.maximum(1.0, 2.0 * left / length))
        if not needed < _MOST_PIECES:
            short = int(np.argmin(np.nan_to_num(length)))
            return (
                f"near t = {t[short]:.4g} the solution is smooth over a small part of a frame "
                "only: it is stiff, or the right-hand side is not smooth there"
            )
        count += len(t)
        found.append((t[:, None] + _FRACTIONS * length[:, None], y[:, None] + moved, flow))
        # What rounding leaves of a frame is no piece of its own.
        more = left - length / 2.0 > late
        t, y = t[more] + length[more] / 2.0, y[more] + moved[more, -1]
        left, length = left[more] - length[more] / 2.0, length[more]
    pieces = [
        Pieces(
            t[own].ravel(),
            y[own].reshape(-1, *y.shape[2:]),
            np.repeat(flow.length[own] / 2.0, _PLACES + 1),
            Flow(flow.length[own], flow.slopes[:, own]),
        )
        for t, y, flow in found
        for own in np.array_split(np.arange(len(t)), -(-len(t) * (_PLACES + 1) // _AT_ONCE))
    ]
    every = np.concatenate([each.t for each in pieces])
    # Where one piece ends the next begins.
    last = np.arange(len(every)) % (_PLACES + 1) == _PLACES
    last[np.argmax(every)] = False
    inner = np.flatnonzero(~last)
    return pieces, inner[np.argsort(every[inner])]
