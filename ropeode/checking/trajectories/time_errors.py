"""Runs that are right, but at another time: steps too many or too few, or a part left out."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import jax
import numpy as np

from ropeode.checking.report import Diagnosis
from ropeode.checking.trajectories.layout import Layout, samples_of
from ropeode.checking.trajectories.run_files import Run
from ropeode.precision import in_float64
from ropeode.problems.problem import Problem
from ropeode.references.reference import Reference

# A shift in time explains an error of which it leaves no more than this, in the finest run that
# it shifts and in the one before.
_LEFT_OVER = (0.05, 0.2)
_ROUNDING = 1e-6

# By how many steps the states of a run are late at each sample time: from the times since the
# start and the number of the frame, in steps.
Clock = Callable[[np.ndarray, np.ndarray], np.ndarray]


def _part(steps: np.ndarray) -> np.ndarray:
    """What is left over of whole steps."""
    left = steps - np.floor(steps + _ROUNDING)
    return np.where(left < _ROUNDING, 0.0, left)


def _in_each_frame(ends: np.ndarray, part: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """The sum over the frames of a part of each."""
    return np.cumsum(part(np.diff(ends, prepend=0.0)))


def _missing(steps: np.ndarray) -> np.ndarray:
    """What is missing to whole steps."""
    left = _part(steps)
    return np.where(left > 0.0, 1.0 - left, 0.0)


# How programs count wrongly. None has a number that could be fitted.
_CLOCKS: tuple[tuple[str, str, Clock], ...] = (
    ("step-count", "one step too few is made in each frame", lambda ends, frame: -frame),
    ("step-count", "one step too many is made in each frame", lambda ends, frame: frame),
    (
        "step-count",
        "one step too few is made in the first frame",
        lambda ends, frame: -np.minimum(frame, 1),
    ),
    (
        "step-count",
        "one step too many is made in the first frame",
        lambda ends, frame: np.minimum(frame, 1),
    ),
    (
        "last-step",
        "where dt does not divide a frame, the last part of it is skipped",
        lambda ends, frame: -_in_each_frame(ends, _part),
    ),
    (
        "last-step",
        "where dt does not divide a frame, the last step of it goes beyond its end",
        lambda ends, frame: _in_each_frame(ends, _missing),
    ),
    (
        "last-step",
        "where dt does not divide the time of a sample, the sample is of the step before it",
        lambda ends, frame: -_part(ends),
    ),
    (
        "last-step",
        "where dt does not divide the time of a sample, the sample is of the step after it",
        lambda ends, frame: _missing(ends),
    ),
)


def clock_diagnosis(reference: Reference, runs: Sequence[Run]) -> Diagnosis | None:
    """A way of counting steps wrongly that explains the errors, if there is one.

    Arguments:
        reference: of the problem.
        runs: from coarse to fine.
    """
    problem, known = reference.problem, slice(0, reference.trusted)
    moving = _derivatives(problem, reference.states[known])
    since, frame = problem.ts[known] - problem.ts[0], np.arange(reference.trusted)
    best: tuple[float, Diagnosis] | None = None
    for cause, words, clock in _CLOCKS:
        left: list[float] = []
        shifted: list[float] = []
        for run in reversed(runs):
            late = run.dt * clock(since / run.dt, frame)
            # A step that divides all frames leaves no part that could be skipped.
            if np.any(late) and len(left) < len(_LEFT_OVER):
                left.append(_left_over(problem, run, moving, late))
                shifted.append(run.dt)
        if len(left) == len(_LEFT_OVER) and all(
            one <= most for one, most in zip(left, _LEFT_OVER, strict=True)
        ):
            share = 100.0 * (1.0 - left[0])
            line = f"{words}: that explains {share:.3g}% of the errors at dt = {shifted[0]:.4g}"
            if best is None or left[0] < best[0]:
                best = left[0], Diagnosis(cause, line, {"left_over": left[0]})
    return None if best is None else best[1]


def _left_over(
    problem: Problem, run: Run, moving: tuple[np.ndarray, ...], late: np.ndarray
) -> float:
    """What a shift in time leaves of the errors, of all quantities the largest share."""
    state, rate, change = moving
    late = late.reshape(-1, *[1] * (state.ndim - 1))
    shifted = samples_of(problem, state + late * rate + 0.5 * late**2 * change)
    right, dim = samples_of(problem, state), Layout.of(problem).dim
    shares = []
    for first in range(0, run.values.shape[2], dim):
        part = slice(first, first + dim)
        given = run.values[: len(state), :, part]
        error = float(np.max(np.abs(given - right[:, :, part])))
        left = float(np.max(np.abs(given - shifted[:, :, part])))
        shares.append(left / error if error > 0.0 else np.inf)
    return max(shares)


@in_float64
def _derivatives(problem: Problem, states: np.ndarray) -> tuple[np.ndarray, ...]:
    """States with their first and second derivatives in time, each ``(times, *state)``."""

    def both(t: float, y: np.ndarray) -> tuple:
        rate = problem.rhs(t, y, problem.args)
        _, change = jax.jvp(lambda t, y: problem.rhs(t, y, problem.args), (t, y), (1.0, rate))
        return rate, change

    rates, changes = jax.jit(jax.vmap(both))(problem.ts[: len(states)], states)
    return states, np.asarray(rates), np.asarray(changes)
