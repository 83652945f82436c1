"""Samples of another time: too many steps, too few, a partial one left out, half a step."""

from __future__ import annotations

import dataclasses
import math
import operator
from collections.abc import Callable, Sequence
from typing import Literal, NamedTuple

import numpy as np

from ropeode.analysis import differences, moved
from ropeode.checking.report import Diagnosis
from ropeode.checking.trajectories.convergence import beginning, order_finding
from ropeode.checking.trajectories.layout import samples_of
from ropeode.checking.trajectories.run_files import Run
from ropeode.norms import NORMS
from ropeode.references import Reference, time_derivatives

# A mistake explains errors if at most these parts of them remain in the finest run and in the next.
_REMAINDERS = (0.05, 0.2)
# Or if this part remains in the finest run, and falls over so many runs with a power of dt between
# these: the mistake explains the leading term, and the next one or two orders remain.
_LARGEST, _LEAST_POWER, _LARGEST_POWER = 0.25, 0.75, 2.5
RUNS = 3
# Or if this part of the errors of the finest of some runs remains, and so changed all converge.
_PART = 0.5
# No mistake explains the errors if some run is right without it.
_WORSE = 2.0
_ROUNDING = 1e-6
# How closely steps fill a frame that are counted by the time; and the most that are counted so.
_WHOLE, _MOST_STEPS = 1e-9, 2**21
# Derivatives of the solution from which late states follow.
_DERIVATIVES = 4
# Taylor's series has come to an end where its last term is this part of the sum.
_LAST_TERM = 0.01
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
_WELL_KNOWN_ALONE = {
    (("position",), 0.5): (
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


# Weights of states, and by how many steps each of them is late.
Mixture = list[tuple[np.ndarray | float, np.ndarray]]


class _Samples(NamedTuple):
    """The samples of one run, with its step as the unit of time.

    Fields:
        ends: their times since the start.
        frame: the number of the frame that each of them ends.
        ts: their times in the problem's unit.
        dt: step size.
    """

    ends: np.ndarray
    frame: np.ndarray
    ts: np.ndarray
    dt: float

    def in_each_frame(self, part: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
        """The sum of a part of each frame, over the frames."""
        return np.cumsum(part(np.diff(self.ends, prepend=0.0)))

    def added_up(self, *, in_frames: bool, side: Literal["left", "right"]) -> np.ndarray:
        """The steps too many where rounded steps are added up to the time, and that is compared.

        Arguments:
            in_frames: whether it begins at 0 in each frame, rather than once.
            side: `left` for ``while t < end``, `right` for ``while t <= end``.
        """
        off = np.abs(self.ends - np.rint(self.ends))
        if self.ends[-1] > _MOST_STEPS or np.any(off > _WHOLE * self.ends):
            return np.zeros_like(self.ends)
        ends = np.diff(self.ts, prepend=self.ts[0]) if in_frames else self.ts
        times = np.full(round(self.ends[-1]) + 2, self.dt)
        times[0] = 0.0 if in_frames else self.ts[0]
        made = np.searchsorted(np.cumsum(times), ends, side)
        made[0] = 0
        return (np.cumsum(made) if in_frames else made) - np.rint(self.ends)


class Delay(NamedTuple):
    """A mistake by which samples are late; none of them has a parameter to fit.

    Fields:
        cause: a keyword.
        words: describe it to its author; `{these}` stands for the quantities that are late, and
            `{dt}` and `{frame}` for the first run and frame in which they are.
        steps: by how many steps each sample is late.
        fix: how to mend it; empty if the words say it.
        constant: if each sample is late alike, by how many steps.
        alone: whether one quantity may be late, and the others in time.
        line: whether samples lie on a straight line from the step before, which is so many steps
            too early, to the next one.
    """

    cause: str
    words: str
    steps: Callable[[_Samples], np.ndarray]
    fix: str = ""
    constant: float | None = None
    alone: bool = False
    line: bool = False

    def mixture(self, samples: _Samples) -> Mixture:
        """The weights of states in each sample, and by how many steps they are late."""
        steps = self.steps(samples)
        return [(1.0 + steps, steps), (-steps, 1.0 + steps)] if self.line else [(1.0, steps)]


def _part(steps: np.ndarray) -> np.ndarray:
    """The fraction of a step that remains after whole steps."""
    rest = steps - np.floor(steps + _ROUNDING)
    return np.where(rest < _ROUNDING, 0.0, rest)


def _missing(steps: np.ndarray) -> np.ndarray:
    """The fraction of a step that is missing to whole steps."""
    return -_part(steps) % 1.0


# What a program makes in place of the right number of steps.
_COUNTS = {
    "one step too few in each frame": lambda of: -1.0 * of.frame,
    "one step too many in each frame": lambda of: 1.0 * of.frame,
    "one step too few in the first frame": lambda of: -1.0 * np.minimum(of.frame, 1),
    "one step too many in the first frame": lambda of: 1.0 * np.minimum(of.frame, 1),
}
# What dt does not divide, and what happens then.
_LAST_STEPS = {
    "a frame, the program skips the last partial step": lambda of: -of.in_each_frame(_part),
    "a frame, its last step goes beyond the end of the frame": (
        lambda of: of.in_each_frame(_missing)
    ),
    "a sample time, the sample is taken from the step before it": lambda of: -_part(of.ends),
    "a sample time, the sample is taken from the step after it": lambda of: _missing(of.ends),
    "a frame, the program makes the nearest whole number of steps": (
        lambda of: of.in_each_frame(lambda steps: np.rint(steps) - steps)
    ),
    "a sample time, the sample is taken from the nearest step": (
        lambda of: np.rint(of.ends) - of.ends
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
    *(
        Delay(
            "extra-step",
            "at dt = {dt:.4g} there is a step too many in frame {frame}: rounded steps are added "
            f"up to a time that is {compared} the end of the frame",
            lambda of, how=how: of.added_up(**how),
            "count the steps: for (i = 0; i < steps_per_frame; i++)",
        )
        for compared, side in (("still below", "left"), ("not yet above", "right"))
        for how in ({"in_frames": False, "side": side}, {"in_frames": True, "side": side})
    ),
    Delay(
        "straight-line",
        "samples lie on a straight line between the steps before and after them, which is wrong "
        "by up to dt^2/8 times the acceleration",
        lambda of: -_part(of.ends),
        "make the last step before each sample shorter, or interpolate with the slopes at both "
        "steps (Hermite)",
        line=True,
    ),
    Delay(
        "sample-time",
        "the first row is the state after the first step, and the others are of their time",
        lambda of: 1.0 * (of.frame == 0),
        "write the initial state before the first step",
    ),
    *(
        Delay(
            "sample-time",
            f"{{these}} are those of {words}",
            lambda of, late=late: np.full(len(of.ends), late),
            fix,
            late,
            alone=True,
        )
        for late, words, fix in _ALWAYS
    ),
    Delay(
        "sample-time",
        "{these} are those before the last step of each frame",
        lambda of: _missing(np.diff(of.ends, prepend=0.0)) - 1.0,
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
    well_known = _WELL_KNOWN | (_WELL_KNOWN_ALONE if quantities == ("position",) else {})
    best: Diagnosis | None = None
    for delay in _DELAYS:
        one = [(name,) for name in quantities] if delay.alone and len(quantities) > 1 else []
        for names in (quantities, *one):
            if (found := shifts.explained(delay, names)) is None:
                continue
            fine, coarse, left = found
            # Of delays that are the same here, the first one counts.
            if best and left >= _LESS * best.evidence["left_over"]:
                continue
            these = _PLURAL[names[0]] if len(names) == 1 else "samples"
            words = delay.words.format(these=these, dt=coarse.run.dt, frame=coarse.frame)
            reason, fix = well_known.get((names, delay.constant), ("", delay.fix))
            words += f", {reason}" if reason else ""
            whose = "the" if names == quantities else "their"
            words += f"; this explains {100.0 * (1.0 - left):.3g}% of {whose} errors"
            words += f" at dt = {fine.run.dt:.4g}"
            best = Diagnosis(delay.cause, words, {"left_over": left, "late": [*names]}, fix)
    return best


class _Late(NamedTuple):
    """A run beside what a delay makes of the solution.

    Fields:
        run: from a file.
        errors: of its samples, ``(samples, *state)``.
        off: how far samples are from those of their time by the delay, likewise.
        end: for so many samples this is known.
        frame: the first sample that is late; the number of samples if none is.
    """

    run: Run
    errors: np.ndarray
    off: np.ndarray
    end: int
    frame: int


class _Shifts:
    """Compares the errors of runs with those of a solution that is late."""

    def __init__(self, reference: Reference, runs: Sequence[Run]):
        self.problem, self.runs, self._reference = reference.problem, runs, reference
        trusted = reference.trusted
        self._ts = self.problem.ts[:trusted]
        self._derivatives = time_derivatives(
            self.problem, self._ts, reference.states[:trusted], _DERIVATIVES
        )
        self._errors = [differences(run.states, reference) for run in runs]
        self._motion = {name: moved(reference, NORMS[f"{name}-max"]) for name in runs[0].quantities}

    def explained(self, delay: Delay, names: Sequence[str]) -> tuple[_Late, _Late, float] | None:
        """Whether a delay explains the errors of some quantities.

        Returns:
            The finest and the coarsest run that are late, and the part of the errors that is left
            over in the finest; None if the delay does not explain them.
        """
        samples, dim = len(self._ts), self.runs[0].layout.dim
        places = [*map(self.problem.quantities.index, names)]
        columns = slice(places[0] * dim, (places[-1] + 1) * dim)
        moves = self._ts > self._ts[0] if all(run.begins(columns) for run in self.runs) else True
        every = [self._late(k, delay, moves) for k in range(len(self.runs) - 1, -1, -1)]
        # A run that is too late for the series says nothing.
        known = [each for each in every if each.frame < each.end or each.frame == samples]
        # A step that divides all frames leaves no partial step that could be skipped.
        late = [each for each in known if each.frame < samples]
        parts = [max(self._left(each, name) for name in names) for each in late]
        others = [name for name in self.runs[0].quantities if name not in names]
        if not late or max(parts) > _WORSE:
            return None
        if not explains(parts[:RUNS], [each.run.dt for each in late[:RUNS]]) and not (
            # Where some runs are late, the others show what the program does otherwise.
            not others
            and parts[0] <= _PART
            and (len(late) < len(self.runs) or delay.cause == "last-step")
            and self._pass_without(known)
        ):
            return None
        if any(self._as_late(other, names, late[0], late[1]) for other in others):
            return None
        return late[0], late[-1], parts[0]

    def _late(self, k: int, delay: Delay, moves: np.ndarray | bool) -> _Late:
        """A run beside a mixture of late states, by Taylor's series."""
        run, steps = self.runs[k], (self._ts - self._ts[0]) / self.runs[k].dt
        mixture = delay.mixture(_Samples(steps, np.arange(len(steps)), self._ts, run.dt))
        far = term = np.zeros_like(self._derivatives[:, 0])
        for power in range(1, self._derivatives.shape[1]):
            factor = np.sum(
                [weight * (run.dt * steps) ** power for weight, steps in mixture], axis=0
            )
            factor = moves * factor / math.factorial(power)
            term = factor.reshape(-1, *[1] * (far.ndim - 1)) * self._derivatives[:, power]
            far = far + term
        sizes = [np.max(np.abs(each).reshape(len(each), -1), axis=1) for each in (term, far)]
        # Where its last term is small, the series has come to an end.
        coarse = sizes[0] > _LAST_TERM * np.maximum.accumulate(sizes[1])
        is_late = moves * mixture[0][1] != 0.0
        end, frame = (int(np.argmax([*when, True])) for when in (coarse, is_late))
        return _Late(run, self._errors[k], far, end, frame)

    def _pass_without(self, runs: Sequence[_Late]) -> bool:
        """Whether runs converge to the solution that are so far off by being late."""
        undone = []
        for run, _, off, *_ in reversed(runs):
            values = run.values.copy()
            values[: len(off)] -= samples_of(self.problem, off)[:, :, : values.shape[2]]
            undone.append(dataclasses.replace(run, values=values))
        end = min(each.end for each in runs)
        reference = beginning(self._reference, end - 1)
        return reference is not None and order_finding(reference, undone, None)[0].status == "pass"

    def _size(self, name: str, states: np.ndarray) -> float:
        return float(np.max(np.abs(self.problem.quantity(name, states)), initial=0.0))

    def _left(self, late: _Late, name: str) -> float:
        """The part of the errors of a quantity that a shift in time does not explain."""
        _, errors, off, end, _ = late
        error = self._size(name, errors[:end])
        return self._size(name, (errors - off)[:end]) / error if error > 0.0 else np.inf

    def _as_late(self, other: str, names: Sequence[str], fine: _Late, coarse: _Late) -> bool:
        """Whether the errors of another quantity are as large, and fall no faster, than these."""

        def relative(each: _Late, name: str) -> float:
            return self._size(name, each.errors) / self._motion[name]

        def falls(name: str) -> float:
            return relative(fine, name) / relative(coarse, name)

        if relative(fine, other) <= _IN_TIME * max(relative(fine, name) for name in names):
            return False
        return falls(other) > _FASTER * max(map(falls, names))
