"""The coefficients of a method, read off its step.

An explicit step asks for slopes one by one, at states that are sums of the initial state and of the
slopes before. Each slope is answered by a vector that no other one has a part of: then the parts of
what is asked next, and of the result, are the coefficients. They are tried with random slopes at
other times, step sizes and states.

To an implicit step slopes are given that depend on time alone: each stage's slope is known before
its equation is solved. So a component whose slope is 1 at the time of one stage, and 0 at those of
all others, shows the weight of that stage. A second component whose slope is the first one, at the
time of another stage alone, shows the entry of the matrix. The stages' equations are linear then,
and Newton's method, like any other, solves them up to rounding.
"""

from __future__ import annotations

import numpy as np

from ropeode.tableaus import NystromTableau, Tableau
from ropeode.tableaus.stages import Row, as_fraction
from ropeode.theory.recorded_step import NotReadable, RecordedStep, Recording, TooManyCalls

# A method of more stages than these is none that anybody has published.
_MOST_STAGES = 64
# Powers of two, so that products with the step size and quotients by it are exact.
_DT = 0.25
# How closely a step must agree with its tableau, in units of the largest number that takes part;
# and what is told apart from another kind of step, such as one that rounds to float32.
_SAME, _NEARLY = 1e-13, 1e-5
# Where the tableau is tried: time, step size, size of the state and of what is added to it. With
# what a failure there shows, as the end of a sentence that begins with "it".
_TRIALS = (
    ("is not a sum of the state and of slopes with constant factors", 0.0, _DT, 1.0),
    ("treats large states or slopes in another way", 0.0, _DT, 1e4),
    ("treats small states or slopes in another way", 0.0, _DT, 1e-5),
    ("has coefficients that depend on the step size", 0.0, 2.0, 1.0),
    ("has coefficients that depend on the step size", 0.0, 1e-3, 1.0),
    ("has coefficients that depend on the step size", 0.0, 1e-6, 1.0),
    ("has coefficients that depend on the time", 12.3456789, _DT, 1.0),
    ("has coefficients that depend on the time", -7.1234567, _DT, 1.0),
    ("has coefficients that depend on the time", 1234.56789, _DT, 1.0),
)
# Times that differ by less are those of one stage, in units of dt.
_SAME_TIME = 1e-6


class NotASum(NotReadable):
    """What the step asks for and its result are no sums of the state and of slopes."""


class Iterates(NotASum):
    """How many slopes the step takes depends on them, as in an implicit method."""


class ExplicitReading:
    """The coefficients of a step, as they are read off.

    All states that it asks for slopes at, and its result, are sums of signals: the state (of a
    second-order problem positions, and velocities times dt), and the slopes times dt (times dt^2).

    Arguments:
        step: that is watched.
        second_order: whether it is a method for second-order problems, whose state is two signals.
    """

    def __init__(self, step: RecordedStep, second_order: bool):
        halves = 2 if second_order else 1
        self._step, self._halves = step, halves
        self._size = int(np.prod(step.shape)) // halves
        random = np.random.default_rng(14)
        self._signals = random.standard_normal((halves + _MOST_STAGES, self._size))
        first = self._watched(self._signals, 0.0, _DT)
        self._stages = len(first.times)
        if not self._stages:
            raise NotReadable("asks for no slope")
        if not np.all(np.isfinite(first.result)):
            raise NotReadable("gives not-a-number")
        self._read()
        again = self._watched(self._signals, 0.0, _DT)
        if not all(map(np.array_equal, first, again)):
            raise NotReadable("keeps hidden state: the same input gave different output")

    def _watched(self, signals: np.ndarray, t: float, dt: float) -> Recording:
        """A step on some signals, ``(halves + slopes, size)``."""
        halves, shape = self._halves, self._step.shape
        powers = dt ** -np.arange(halves, dtype=float)
        y = (signals[:halves] * powers[:, None]).reshape(shape)

        def slope(i: int, t: float, y: np.ndarray) -> np.ndarray:
            k = signals[halves + i] * dt**-halves
            return np.stack([y[1], k]) if halves == 2 else k.reshape(shape)

        try:
            return self._step.run(slope, t, y, dt, most_calls=_MOST_STAGES)
        except TooManyCalls:
            raise Iterates("iterates: what it asks for depends on the slopes") from None

    def _parts(self, recording: Recording, dt: float) -> np.ndarray:
        """What was asked for and the result, as signals, ``(slopes + 1, halves, size)``."""
        if len(recording.times) != self._stages:
            raise Iterates("takes a number of slopes that depends on them")
        outputs = np.concatenate([recording.states, recording.result[None]])
        outputs = outputs.reshape(self._stages + 1, self._halves, self._size)
        return outputs * dt ** np.arange(self._halves, dtype=float)[:, None]

    def _read(self) -> None:
        """Read coefficients, ``(slopes + 1, halves, signals)``, and times of the slopes."""
        count = self._halves + self._stages
        self._coefficients = np.zeros((self._stages + 1, self._halves, count))
        for start in range(0, count, self._size):
            block = np.arange(start, min(start + self._size, count))
            signals = np.zeros_like(self._signals)
            signals[block, block - start] = 1.0
            recording = self._watched(signals, 0.0, _DT)
            parts = self._parts(recording, _DT)
            self._coefficients[:, :, block] = parts[:, :, : len(block)]
        self._times = recording.times / _DT

    def check(self) -> None:
        """See that the coefficients are the same ones at all times, step sizes and states.

        Raises:
            NotReadable: they are not.
        """
        for what, t, dt, scale in _TRIALS:
            signals = scale * self._signals[: self._halves + self._stages]
            recording = self._watched(scale * self._signals, t, dt)
            parts = self._parts(recording, dt)
            size = scale * np.max(np.abs(self._signals)) * self._largest()
            error = np.max(np.abs(parts - self._coefficients @ signals)) / size
            late = np.max(np.abs(recording.times - (t + self._times * dt)))
            if error <= _SAME and late <= _SAME * (abs(t) + dt):
                continue
            if what is _TRIALS[0][0] and error <= _NEARLY:
                what = f"is a sum of the state and of slopes up to a relative error of {error:.0e}"
            raise (NotASum if what is _TRIALS[0][0] else NotReadable)(what)

    def _largest(self) -> float:
        return float(np.max(np.sum(np.abs(self._coefficients), axis=-1)))

    def runge_kutta(self) -> Tableau:
        """As a Runge-Kutta method.

        Raises:
            NotReadable: the state itself is multiplied by a number.
        """
        of_state, of_slopes = self._coefficients[:, 0, 0], self._coefficients[:, 0, 1:]
        self._check_kept("the state", of_state)
        *a, b = map(fractions, of_slopes)
        return Tableau(tuple(a), b, fractions(self._times))

    def nystrom(self) -> NystromTableau:
        """As a Nystrom method.

        Raises:
            NotReadable: positions or velocities are multiplied by a number, or mixed.
        """
        positions, velocities = np.moveaxis(self._coefficients, 1, 0)
        sees_velocities = np.all(np.any(velocities[:-1], axis=1))
        seen = velocities if sees_velocities else velocities[-1:]
        self._check_kept("the positions", positions[:, 0])
        self._check_kept("the velocities", seen[:, 1])
        self._check_kept("the velocities on their way into the positions", positions[-1:, 1])
        if np.any(np.abs(velocities[:, 0]) > _SAME):
            raise NotReadable("takes velocities from positions, which are no slopes")
        *p, q = map(fractions, positions[:, 2:])
        *a, b = map(fractions, velocities[:, 2:])
        return NystromTableau(
            p=tuple(p),
            q=q,
            a=tuple(a) if sees_velocities else None,
            b=b,
            c=fractions(self._times),
            d=fractions(positions[:-1, 1]),
        )

    def _check_kept(self, what: str, factors: np.ndarray) -> None:
        worst = factors[np.argmax(np.abs(factors - 1.0))]
        if abs(worst - 1.0) > _SAME:
            where = "its result" if factors[-1] != 1.0 else "a stage"
            raise NotReadable(f"multiplies {what} by {worst:.10g} in {where}")


def fractions(row: np.ndarray) -> Row:
    """Numbers as fractions, where they are the roundings of such."""
    return tuple(as_fraction(float(entry)) for entry in row)


def read_implicit(step: RecordedStep) -> Tableau:
    """The only tableau that a step may have, if its stages are at different times.

    Arguments:
        step: on states of enough components: one for each stage and each pair of stages.

    Raises:
        NotReadable: the state has too few components.
    """
    size = int(np.prod(step.shape))
    resting = step.run(lambda i, t, y: np.zeros_like(y), 0.0, np.zeros(step.shape), _DT)
    times = _apart(resting.times / _DT)
    stages = len(times)
    if not stages or stages + stages**2 > size:
        raise NotReadable("takes slopes at too many times")

    def slope(i: int, t: float, y: np.ndarray) -> np.ndarray:
        now = np.zeros(stages)
        now[np.argmin(np.abs(t / _DT - times))] = 1.0
        k, flat = np.zeros(size), y.reshape(-1)
        k[:stages] = now
        k[stages : stages + stages**2] = np.outer(now, flat[:stages]).reshape(-1)
        return k.reshape(step.shape)

    result = step.run(slope, 0.0, np.zeros(step.shape), _DT).result.reshape(-1)
    if not np.all(np.isfinite(result)):
        raise NotReadable("gives not-a-number")
    b = result[:stages] / _DT
    pairs = result[stages : stages + stages**2].reshape(stages, stages) / _DT**2
    # Slopes without weight are first guesses.
    (kept,) = np.nonzero(b)
    if not len(kept):
        raise NotReadable("takes slopes that have no weight")
    a = pairs[np.ix_(kept, kept)] / b[kept, None]
    return Tableau(tuple(map(fractions, a)), fractions(b[kept]), fractions(times[kept]))


def _apart(times: np.ndarray) -> np.ndarray:
    """Times without repetitions, in order: that in which a step asks for stages says nothing."""
    different: list[float] = []
    for time in np.sort(times):
        if all(abs(time - other) > _SAME_TIME for other in different):
            different.append(float(time))
    return np.array(different)
