"""Runs that are right at another time: too many steps, too few, or a partial one left out."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import jax
import numpy as np

from ropeode.analysis.errors import differences
from ropeode.checking.report import Diagnosis
from ropeode.checking.trajectories.run_files import Run
from ropeode.precision import in_float64
from ropeode.problems.problem import Problem
from ropeode.references.reference import Reference

# A shift in time explains the errors if at most these parts of them remain, in the finest run that
# it shifts and in the next one.
_REMAINDERS = (0.05, 0.2)
_ROUNDING = 1e-6

# By how many steps each sample is late, from the time since the start in steps, and the number of
# the frame.
Delay = Callable[[np.ndarray, np.ndarray], np.ndarray]


def _part(steps: np.ndarray) -> np.ndarray:
    """The fraction of a step that remains after whole steps."""
    rest = steps - np.floor(steps + _ROUNDING)
    return np.where(rest < _ROUNDING, 0.0, rest)


def _in_each_frame(ends: np.ndarray, part: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """The sum of a part of each frame, over the frames."""
    return np.cumsum(part(np.diff(ends, prepend=0.0)))


def _missing(steps: np.ndarray) -> np.ndarray:
    """The fraction of a step that is missing to whole steps."""
    rest = _part(steps)
    return np.where(rest > 0.0, 1.0 - rest, 0.0)


# How programs make a wrong number of steps. None of these has a parameter to fit.
_DELAYS: tuple[tuple[str, str, Delay], ...] = (
    ("step-count", "the program makes one step too few in each frame", lambda ends, frame: -frame),
    ("step-count", "the program makes one step too many in each frame", lambda ends, frame: frame),
    (
        "step-count",
        "the program makes one step too few in the first frame",
        lambda ends, frame: -np.minimum(frame, 1),
    ),
    (
        "step-count",
        "the program makes one step too many in the first frame",
        lambda ends, frame: np.minimum(frame, 1),
    ),
    (
        "last-step",
        "if dt does not divide a frame, the program skips the last partial step",
        lambda ends, frame: -_in_each_frame(ends, _part),
    ),
    (
        "last-step",
        "if dt does not divide a frame, its last step goes beyond the end of the frame",
        lambda ends, frame: _in_each_frame(ends, _missing),
    ),
    (
        "last-step",
        "if dt does not divide a sample time, the sample is taken from the step before it",
        lambda ends, frame: -_part(ends),
    ),
    (
        "last-step",
        "if dt does not divide a sample time, the sample is taken from the step after it",
        lambda ends, frame: _missing(ends),
    ),
)


def timing_diagnosis(reference: Reference, runs: Sequence[Run]) -> Diagnosis | None:
    """A wrong number of steps that explains the errors, if there is one."""
    problem, trusted = reference.problem, slice(0, reference.trusted)
    rates, changes = _derivatives(problem, reference.states[trusted])
    elapsed, frame = problem.ts[trusted] - problem.ts[0], np.arange(reference.trusted)
    errors = {run.path: differences(run.states, reference) for run in runs}
    best: tuple[float, Diagnosis] | None = None
    for cause, words, delay in _DELAYS:
        remainders: list[float] = []
        shifted: list[float] = []
        for run in reversed(runs):
            late = run.dt * delay(elapsed / run.dt, frame)
            # A step that divides all frames leaves no partial step that could be skipped.
            if np.any(late) and len(remainders) < len(_REMAINDERS):
                late = late.reshape(-1, *[1] * (rates.ndim - 1))
                explained = late * rates + 0.5 * late**2 * changes
                remainders.append(_remainder(problem, errors[run.path], explained, run.quantities))
                shifted.append(run.dt)
        if len(remainders) == len(_REMAINDERS) and all(
            one <= most for one, most in zip(remainders, _REMAINDERS, strict=True)
        ):
            share = 100.0 * (1.0 - remainders[0])
            line = f"{words}; this explains {share:.3g}% of the errors at dt = {shifted[0]:.4g}"
            if best is None or remainders[0] < best[0]:
                best = remainders[0], Diagnosis(cause, line, {"left_over": remainders[0]})
    return None if best is None else best[1]


def _remainder(
    problem: Problem, errors: np.ndarray, explained: np.ndarray, quantities: Sequence[str]
) -> float:
    """The largest part of the errors of a quantity that a shift in time does not explain."""
    parts = []
    for name in quantities:
        error = float(np.max(np.abs(problem.quantity(name, errors))))
        rest = float(np.max(np.abs(problem.quantity(name, errors - explained))))
        parts.append(rest / error if error > 0.0 else np.inf)
    return max(parts)


@in_float64
def _derivatives(problem: Problem, states: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The first and second derivatives of states in time, each ``(times, *state)``."""

    def both(t: float, y: np.ndarray) -> tuple:
        rate = problem.rhs(t, y, problem.args)
        _, change = jax.jvp(lambda t, y: problem.rhs(t, y, problem.args), (t, y), (1.0, rate))
        return rate, change

    rates, changes = jax.jit(jax.vmap(both))(problem.ts[: len(states)], states)
    return np.asarray(rates), np.asarray(changes)
