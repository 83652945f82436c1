"""Samples of another time: too many steps, too few, a partial one left out, half a step."""

from __future__ import annotations

import functools
import operator
from collections.abc import Callable, Sequence
from typing import NamedTuple

import jax
import numpy as np

from ropeode.analysis import differences, moved
from ropeode.checking.report import Diagnosis
from ropeode.checking.trajectories.initial_states import begins_right
from ropeode.checking.trajectories.run_files import Run
from ropeode.norms import NORMS
from ropeode.precision import in_float64
from ropeode.references import Reference

# A mistake explains errors if at most these parts of them remain in the finest run and in the next.
_REMAINDERS = (0.05, 0.2)
# Or if this part remains in the finest run, and falls over so many runs with a power of dt between
# these: the mistake explains the leading term, and the next one or two orders remain.
_LARGEST, _LEAST_POWER, _LARGEST_POWER = 0.25, 0.75, 2.5
RUNS = 3
_ROUNDING = 1e-6
# If only one quantity is late, the errors of the others are smaller by this factor, as parts of the
# motion, or fall faster with dt by that one.
_IN_TIME, _FASTER = 0.2, 0.75
_LESS = 1.0 - 1e-6
_PLURAL = {"position": "positions", "velocity": "velocities", "state": "samples"}
# What is well known to give samples so many steps late, and how to mend it.
_WELL_KNOWN: dict[tuple[tuple[str, ...], float | None], tuple[str, str]] = {
    (("velocity",), -0.5): (
        "as leapfrog and backward differences (x_n - x_(n-1))/dt give them",
        "write velocities of the time of the positions",
    ),
    (("velocity",), 0.5): (
        "as leapfrog and forward differences (x_(n+1) - x_n)/dt give them",
        "write velocities of the time of the positions",
    ),
    (("position",), 0.5): (
        "as semi-implicit Euler gives them, whose velocities begin with a whole step",
        "let the velocities begin with half a step",
    ),
    (("position",), -0.5): (
        "as explicit Euler gives them from rest while forces hardly change",
        "let positions move with the mean of the old velocity and the new one",
    ),
    (("position", "velocity"), 0.5): (
        "as Störmer and Verlet's method gives them that begins at rest with x(-dt) = x(0)",
        "begin with x(-dt) = x(0) - dt v(0) + dt^2/2 a(0)",
    ),
}
# The same of files that have positions alone.
_WELL_KNOWN_ALONE: dict[float | None, tuple[str, str]] = {
    0.5: (
        "as semi-implicit Euler gives them, and from rest Verlet's method with x(-dt) = x(0)",
        "begin with a velocity of half a step, or with x(-dt) = x(0) - dt v(0) + dt^2/2 a(0)",
    ),
}


def explains(parts: Sequence[float], dts: Sequence[float]) -> bool:
    """Whether so little remains that a mistake without free parameters explains the errors.

    Arguments:
        parts: of the errors that remain in each run, from the finest on; `RUNS` are enough.
        dts: their step sizes.
    """
    if len(parts) >= len(_REMAINDERS) and all(map(operator.le, parts, _REMAINDERS)):
        return True
    if len(parts) < RUNS or parts[0] > _LARGEST or min(parts) <= 0.0:
        return False
    powers = np.diff(np.log(parts)) / np.diff(np.log(dts))
    return bool(np.all((powers >= _LEAST_POWER) & (powers <= _LARGEST_POWER)))


class Delay(NamedTuple):
    """A mistake by which samples are late; none of them has a parameter to fit.

    Fields:
        cause: a keyword.
        words: describe it to its author; `{these}` stands for the quantities that are late.
        steps: by how many steps each sample is late, from the time since the start in steps, and
            the number of the frame.
        fix: how to mend it; empty if the words say it.
        constant: if each sample is late alike, by how many steps.
        alone: whether one quantity may be late, and the others in time.
    """

    cause: str
    words: str
    steps: Callable[[np.ndarray, np.ndarray], np.ndarray]
    fix: str = ""
    constant: float | None = None
    alone: bool = False


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


def _last_step(steps: np.ndarray) -> np.ndarray:
    """The size of the last step of a frame, as a part of the usual one."""
    rest = _part(steps)
    return np.where(rest > 0.0, rest, 1.0)


# What a program makes in place of the right number of steps.
_COUNTS = {
    "one step too few in each frame": lambda _, n: -1.0 * n,
    "one step too many in each frame": lambda _, n: 1.0 * n,
    "one step too few in the first frame": lambda _, n: -1.0 * np.minimum(n, 1),
    "one step too many in the first frame": lambda _, n: 1.0 * np.minimum(n, 1),
}
# What dt does not divide, and what happens then.
_LAST_STEPS = {
    "a frame, the program skips the last partial step": (
        lambda ends, _: -_in_each_frame(ends, _part)
    ),
    "a frame, its last step goes beyond the end of the frame": (
        lambda ends, _: _in_each_frame(ends, _missing)
    ),
    "a sample time, the sample is taken from the step before it": lambda ends, _: -_part(ends),
    "a sample time, the sample is taken from the step after it": lambda ends, _: _missing(ends),
    "a frame, the program makes the nearest whole number of steps": (
        lambda ends, _: _in_each_frame(ends, lambda steps: np.rint(steps) - steps)
    ),
    "a sample time, the sample is taken from the nearest step": (
        lambda ends, _: np.rint(ends) - ends
    ),
}
_BOTH = "write positions and velocities of the time of the row"
# By how many steps all samples are late, whose state they are, and how to mend it.
_ALWAYS = (
    (
        1.0,
        "one step later: the first row is the state after the first step",
        "write the initial state first, and each row before the next step",
    ),
    (-1.0, "one step earlier", "write them after the last step before their time"),
    (0.5, "half a step later, t + dt/2", _BOTH),
    (-0.5, "half a step earlier, t - dt/2", _BOTH),
)
_DELAYS = (
    *(Delay("step-count", f"the program makes {words}", steps) for words, steps in _COUNTS.items()),
    *(
        Delay("last-step", f"if dt does not divide {words}", steps)
        for words, steps in _LAST_STEPS.items()
    ),
    Delay(
        "sample-time",
        "the first row is the state after the first step, and the others are of their time",
        lambda _, n: 1.0 * (n == 0),
        "write the initial state before the first step",
    ),
    *(
        Delay(
            "sample-time",
            f"{{these}} are those of {words}",
            lambda ends, _, late=late: np.full(len(ends), late),
            fix,
            late,
            alone=True,
        )
        for late, words, fix in _ALWAYS
    ),
    Delay(
        "sample-time",
        "{these} are those before the last step of each frame",
        lambda ends, _: -_last_step(np.diff(ends, prepend=0.0)),
        "write them after it",
        alone=True,
    ),
)


def late_samples(reference: Reference, runs: Sequence[Run]) -> Diagnosis | None:
    """Samples of another time that explain the errors: a wrong number of steps, or half a step.

    The solution at those times is compared with the two finest runs that it concerns.

    Arguments:
        reference: of the problem.
        runs: from coarse to fine; their first samples may be late, too.

    Returns:
        What is late, with the evidence: which quantities, and the part of the errors of the
        finest run that is left over.
    """
    shifts, quantities = _Shifts(reference, runs), runs[0].quantities
    best: Diagnosis | None = None
    for delay in _DELAYS:
        for names in _late_together(delay, quantities):
            found = shifts.left_over(delay, names)
            # Of delays that are the same here, the first one counts.
            if found is None or (best and found[0] >= _LESS * best.evidence["left_over"]):
                continue
            left, dt = found
            these = _PLURAL[names[0]] if len(names) == 1 else "samples"
            words = delay.words.format(these=these)
            known = _WELL_KNOWN.get((names, delay.constant), ("", delay.fix))
            if quantities == ("position",):
                known = _WELL_KNOWN_ALONE.get(delay.constant, known)
            reason, fix = known
            words += f", {reason}" if reason else ""
            whose = "the" if names == tuple(quantities) else "their"
            words += (
                f"; this explains {100.0 * (1.0 - left):.3g}% of {whose} errors at dt = {dt:.4g}"
            )
            best = Diagnosis(delay.cause, words, {"left_over": left, "late": [*names]}, fix)
    return best


def _late_together(delay: Delay, names: Sequence[str]) -> list[tuple[str, ...]]:
    """Which quantities may be late by a delay, and the others in time."""
    each = [(name,) for name in names] if delay.alone and len(names) > 1 else []
    return [tuple(names), *each]


class _Shifts:
    """Compares the errors of runs with those of a solution that is late."""

    def __init__(self, reference: Reference, runs: Sequence[Run]):
        self.problem, self.runs, trusted = reference.problem, runs, reference.trusted
        self._rates, self._changes = _derivatives(reference)
        self._elapsed = self.problem.ts[:trusted] - self.problem.ts[0]
        self._errors = [differences(run.states, reference) for run in runs]
        self._motion = {name: moved(reference, NORMS[f"{name}-max"]) for name in runs[0].quantities}

    def left_over(self, delay: Delay, names: Sequence[str]) -> tuple[float, float] | None:
        """The part of the errors of some quantities that a delay leaves unexplained.

        Returns:
            That of the finest run that is late, and its dt; None if the delay does not explain
            them.
        """
        found: list[tuple[float, int]] = []
        frame = np.arange(len(self._elapsed))
        first = 1.0 * (not begins_right(self.runs, self._columns(names)))
        for k in range(len(self.runs) - 1, -1, -1):
            dt = self.runs[k].dt
            late = dt * delay.steps(self._elapsed / dt, frame)
            late[0] *= first
            # A step that divides all frames leaves no partial step that could be skipped.
            if np.any(late) and len(found) < RUNS:
                late = late.reshape(-1, *[1] * (self._rates.ndim - 1))
                explained = late * self._rates + 0.5 * late**2 * self._changes
                found.append((max(self._left(k, explained, name) for name in names), k))
        if not explains([part for part, _ in found], [self.runs[k].dt for _, k in found]):
            return None
        (left, k), (_, coarser) = found[:2]
        others = [name for name in self.runs[0].quantities if name not in names]
        if any(self._as_late(other, names, k, coarser) for other in others):
            return None
        return left, self.runs[k].dt

    def _columns(self, names: Sequence[str]) -> slice:
        dim, places = self.runs[0].layout.dim, [*map(self.problem.quantities.index, names)]
        return slice(places[0] * dim, (places[-1] + 1) * dim)

    def _error(self, k: int, name: str) -> float:
        return float(np.max(np.abs(self.problem.quantity(name, self._errors[k]))))

    def _left(self, k: int, explained: np.ndarray, name: str) -> float:
        """The part of the errors of a quantity that a shift in time does not explain."""
        error = self._error(k, name)
        rest = self.problem.quantity(name, self._errors[k] - explained)
        return float(np.max(np.abs(rest))) / error if error > 0.0 else np.inf

    def _as_late(self, other: str, names: Sequence[str], fine: int, coarse: int) -> bool:
        """Whether the errors of another quantity are as large, and fall no faster, than these."""

        def relative(k: int, name: str) -> float:
            return self._error(k, name) / self._motion[name]

        def falls(name: str) -> float:
            return relative(fine, name) / relative(coarse, name)

        if relative(fine, other) <= _IN_TIME * max(relative(fine, name) for name in names):
            return False
        return falls(other) > _FASTER * max(map(falls, names))


@functools.lru_cache(maxsize=4)
@in_float64
def _derivatives(reference: Reference) -> tuple[np.ndarray, np.ndarray]:
    """The first and second derivatives of trusted states in time, each ``(times, *state)``."""
    problem, states = reference.problem, reference.states[: reference.trusted]

    def both(t: float, y: np.ndarray) -> tuple:
        rate = problem.rhs(t, y, problem.args)
        _, change = jax.jvp(lambda t, y: problem.rhs(t, y, problem.args), (t, y), (1.0, rate))
        return rate, change

    rates, changes = jax.jit(jax.vmap(both))(problem.ts[: len(states)], states)
    return np.asarray(rates), np.asarray(changes)
