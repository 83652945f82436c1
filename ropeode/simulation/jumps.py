"""Fixed steps on a problem whose right-hand side jumps at declared times.

A step across a jump costs all orders but the first, whatever the method (Hairer, Norsett, Wanner,
Solving Ordinary Differential Equations I, section II.6). So each part of a frame that jumps divide
takes as many equal steps as a frame, the method starts anew at each jump, and the right-hand side
at a jump is the one on the step's own side.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ropeode.problems import Problem
from ropeode.simulation.trajectory import frame_lengths

# Times are the same where they differ by so many units in the last place of the largest: a
# right-hand side that computes when it jumps rounds otherwise than who declares it.
_ROUNDING = 8

# Of each jump the last time before it and the first one after it.
Sides = tuple[tuple[float, float], ...]


class Intervals(NamedTuple):
    """What a run divides into equal steps: frames, and the parts of those in which there are jumps.

    Fields:
        times: their ends, ``(intervals + 1,)``.
        lengths: ``(intervals,)``.
        fresh: whether the method starts anew: at a jump, and wherever one changes the step size,
            ``(intervals,)``.
        samples: the index in `times` of each sample time, ``(times,)``.
    """

    times: np.ndarray
    lengths: np.ndarray
    fresh: np.ndarray
    samples: np.ndarray


def intervals(problem: Problem) -> Intervals:
    """The intervals that a run of a problem divides into equal steps."""
    if not problem.jump_times:
        every = np.arange(problem.frames + 1)
        return Intervals(problem.ts, frame_lengths(problem), every[:-1] == 0, every)
    ts, jumps, near = problem.ts, np.array(problem.jump_times), _rounding(problem)
    jumps = jumps[np.diff(jumps, prepend=-np.inf) > near]
    sample = ts[np.argmin(np.abs(jumps[:, None] - ts), axis=1)]
    jumps = np.where(np.abs(jumps - sample) <= near, sample, jumps)
    times = np.union1d(ts, jumps)
    frame = np.searchsorted(ts, times[:-1], side="right") - 1
    cut = np.bincount(frame)[frame] > 1
    return Intervals(
        times=times,
        lengths=np.where(cut, np.diff(times), frame_lengths(problem)[frame]),
        fresh=cut | np.append(True, cut[:-1]) | np.isin(times[:-1], jumps),
        samples=np.searchsorted(times, ts),
    )


def sides(problem: Problem) -> Sides:
    """Both sides of each jump of a problem's right-hand side."""
    near = _rounding(problem)
    return tuple((jump - near, jump + near) for jump in problem.jump_times)


def _rounding(problem: Problem) -> float:
    return _ROUNDING * float(np.spacing(np.max(np.abs(problem.ts))))


def own_side(sides: Sides, inside: Any) -> Callable[[Any], Any]:
    """Gives times as a step sees them: none is beyond the jumps before and after it.

    Arguments:
        sides: of all jumps.
        inside: a time between those two, such as the middle of the step.
    """
    if not sides:
        return lambda t: t
    traced = isinstance(inside, jax.Array)
    numpy: Any = jnp if traced else np
    before, after = np.array(sides).T
    passed = inside > before
    low = numpy.max(numpy.where(passed, after, -np.inf))
    high = numpy.min(numpy.where(passed, np.inf, before))

    def seen(t: Any) -> Any:
        numpy: Any = jnp if traced or isinstance(t, jax.Array) else np
        return numpy.clip(t, low, high)

    return seen
