"""heyoka's Taylor series method with any number of digits."""

from __future__ import annotations

import dataclasses
import time
from typing import Any

import numpy as np

from ropeode.problems import Problem
from ropeode.progress import Progress, silent
from ropeode.references.extended import heyoka
from ropeode.references.extended.defects import Defects
from ropeode.references.extended.translate import Translation, translate
from ropeode.references.solvers.solution import Path, Solution, Stopwatch
from ropeode.references.solvers.solver import taylor
from ropeode.validation import check_positive, check_whole

# The significand of IEEE quadruple precision.
QUADRUPLE = 113
# Steps of high order last several radians; their parts are like the steps of other solvers.
_PARTS = 16
# That of the x87's numbers, which are by far the fastest beyond float64.
HARDWARE = 64


@dataclasses.dataclass(frozen=True, eq=False)
class ExtendedRun:
    """One run of the Taylor method.

    Arguments:
        precision: of all its numbers, in bits of the significand.
        tolerance: relative, of one step.
        states: ``(times, *state)`` at the sample times that were reached, as `heyoka.real`, or
            as `numpy.longdouble` where it has the precision.
        doubts: at each of these, the sum of how far the steps before are from solving the equation
            at their ends, times their lengths.
        steps: how many.
        seconds: to run.
        compile_seconds: to translate and compile.
        failure: why it did not reach the last sample time; None if it did.
        path: its steps, each in a few parts short enough to be looked into, in float64; only if
            the run is looked into, as are the defects.
        defects: how far its steps are from solving the equation.
    """

    precision: int
    tolerance: float
    states: np.ndarray
    doubts: np.ndarray
    steps: int
    seconds: float = dataclasses.field(compare=False)
    compile_seconds: float = dataclasses.field(compare=False)
    failure: str | None = None
    path: Path | None = None
    defects: Defects | None = dataclasses.field(default=None, compare=False)

    @property
    def rounded(self) -> np.ndarray:
        """The states, each rounded to the nearest float64."""
        return self.states.astype(np.float64)

    @property
    def reached(self) -> int:
        """How many samples it has, the initial state included."""
        return len(self.states)

    @property
    def in_float64(self) -> Solution:
        """The run as one in float64: its states are rounded."""
        return Solution(
            solver=taylor(self.precision),
            rtol=self.tolerance,
            atol=0.0,
            states=self.rounded,
            steps=self.steps,
            seconds=self.seconds,
            compile_seconds=self.compile_seconds,
            failure=self.failure,
        )


def solve(
    problem: Problem,
    *,
    precision: int = QUADRUPLE,
    tolerance: float | None = None,
    time_limit: float = np.inf,
    max_steps: float = np.inf,
    longest_steps: np.ndarray | None = None,
    stops: np.ndarray | None = None,
    shift: np.ndarray | None = None,
    looked_into: bool = False,
    progress: Progress = silent,
) -> ExtendedRun:
    """Solve with Taylor series whose order follows from the tolerance.

    Each sample time is the end of a step, unless `stops` says otherwise. At declared jump
    times the right-hand side is translated anew and the series begin anew. Elsewhere it must be
    one smooth function: the run ends at the last sample before a step after which it would
    choose another branch.

    Arguments:
        problem: what to solve.
        precision: of all numbers, in bits of the significand, 53 or more.
        tolerance: relative error of one step; by default one unit of rounding.
        time_limit: seconds after which the run ends where it is (`Stopwatch`); looked at after each
            step.
        max_steps: after which it ends.
        longest_steps: the longest step in each frame, ``(times - 1,)``; as long as the tolerance
            allows where there is none.
        stops: the sample times at which steps end; at the others the state is that of the step's
            Taylor polynomial, which is within the tolerance all along the step. The last sample
            time is always a stop.
        shift: what is added to the initial state, in float64, of its shape.
        looked_into: whether to keep what its steps do between their ends.
        progress: called at the start.

    Raises:
        InputError: an argument cannot be used, the right-hand side cannot be translated, or
            heyoka is missing.
    """
    # The problem's numbers are float64, which fewer bits could not hold.
    precision = check_whole("precision", precision, at_least=53, example="113")
    if tolerance is None:
        tolerance = 2.0 ** (1 - precision)
    tolerance = check_positive("tolerance", tolerance, example="1e-33")
    progress(f"reference: heyoka Taylor with {precision} bits", None)
    stops = problem.ts if stops is None else np.append(stops, problem.ts[-1])
    watch = Stopwatch()
    if longest_steps is None:
        longest_steps = np.full(problem.frames, np.inf)
    run = _Run(
        problem,
        precision,
        tolerance,
        watch,
        time_limit,
        max_steps,
        longest_steps,
        stops,
        np.zeros_like(problem.y0) if shift is None else shift,
        Defects(problem) if looked_into else None,
    )
    run.to_the_end()
    states = np.stack(run.samples).reshape(-1, *problem.y0.shape)
    return ExtendedRun(
        precision=precision,
        tolerance=tolerance,
        states=states,
        doubts=np.append(run.doubts, np.full(len(states), run.doubt))[: len(states)],
        steps=run.steps,
        seconds=run.seconds,
        compile_seconds=run.compile_seconds,
        failure=run.failure,
        path=run.path() if looked_into else None,
        defects=run.defects,
    )


@dataclasses.dataclass
class _Run:
    """The state of a run that is under way."""

    problem: Problem
    precision: int
    tolerance: float
    watch: Stopwatch
    time_limit: float
    max_steps: float
    longest_steps: np.ndarray
    stops: np.ndarray
    shift: np.ndarray
    defects: Defects | None
    steps: int = 0
    seconds: float = 0.0
    compile_seconds: float = 0.0
    failure: str | None = None
    doubt: float = 0.0

    def __post_init__(self) -> None:
        y0, shift = self.problem.y0.reshape(-1), self.shift.reshape(-1)
        self.samples = [self._exactly(y0) + self._exactly(shift)]
        self.parts: list[tuple] = []
        self.doubts: list[float] = []
        # The slope at the end of the last step by its series, and the step's length.
        self._arriving: tuple[Any, float] | None = None

    def path(self) -> Path:
        """The parts of all steps up to the last sample."""
        start, state = self.problem.ts[0], self.problem.y0.reshape(-1)
        return Path.of(start, state, self.parts).until(self.problem.ts[len(self.samples) - 1])

    def to_the_end(self) -> None:
        """From one jump time to the next, until the end or a failure."""
        ends = [*self.problem.jump_times, float(self.problem.ts[-1])]
        at, state = float(self.problem.ts[0]), self.samples[0]
        for end in ends:
            state = self._piece(at, state, end)
            if self.failure is not None:
                return
            at = end

    def _piece(self, start: float, state: np.ndarray, end: float) -> np.ndarray:
        """Solve a piece without jumps, keep its samples, and return the state at its end."""
        began = time.perf_counter()
        library, shape = heyoka(), self.problem.y0.shape
        rounded = state.astype(np.float64).reshape(shape)
        translation = translate(self.problem, self.precision, t=start, y=rounded)
        taylor = library.taylor_adaptive(
            translation.system,
            state,
            time=self._number(start),
            tol=self._number(self.tolerance),
            **self._kind(),
            # Otherwise some problems of four components take minutes to compile.
            compact_mode=True,
        )
        rates = None
        if self.defects:
            rates = translation.compiled(translation.derivatives, **self._kind())
        self.compile_seconds += time.perf_counter() - began

        began = time.perf_counter()
        self._arriving = None
        ts, first = self.problem.ts, len(self.samples)
        stops = sorted({end, *self.stops[(self.stops > start) & (self.stops < end)].tolist()})
        steps: list[tuple[float, np.ndarray]] = []
        for stop in stops:
            target = self._number(stop)
            frame = int(np.searchsorted(ts, stop)) - 1
            longest = float(self.longest_steps[frame])
            why = self._advance(taylor, rates, target, longest, steps)
            arrived = taylor.time == target and np.all(np.isfinite(taylor.state))
            if arrived and stop in ts:
                self.samples.append(taylor.state.copy())
            # The time limit may be noticed after the very last step.
            if not arrived or (why is not None and stop != ts[-1]):
                why = why or "the state is not finite"
                last = max([start, *(t for t, _ in steps if np.isfinite(t))])
                self.failure = f"stopped after t = {last:g}: {why}"
                break
        self.steps += len(steps)
        self._look_at_guards(translation, steps, end, first)
        self.seconds += time.perf_counter() - began
        return taylor.state.copy()

    def _advance(
        self,
        taylor: Any,
        rates: Any,
        target: Any,
        longest: float,
        steps: list[tuple[float, np.ndarray]],
    ) -> str | None:
        """Step to a time and record each step's end; return why it stopped early, if it did."""
        shortest = 2.0**-self.precision * float(self.problem.ts[-1] - self.problem.ts[0])
        reasons: list[str] = []

        def each_step(taylor: Any) -> bool:
            # The defects of a run that is looked into say more.
            if self.defects is None:
                self._add_doubt(taylor)
            self._read_off(taylor, target)
            steps.append((float(taylor.time), taylor.state.astype(np.float64)))
            if self.defects:
                self._keep_parts(taylor)
                self.defects.keep(taylor, rates)
            if abs(float(taylor.last_h)) < shortest and taylor.time != target:
                reasons.append("its steps become too short")
            elif self.watch.seconds >= self.time_limit:
                reasons.append("the time limit")
            elif self.steps + len(steps) >= self.max_steps:
                reasons.append("too many steps")
            return not reasons

        taylor.propagate_until(
            target, max_delta_t=self._number(longest), callback=each_step, write_tc=True
        )
        return reasons[0] if reasons else None

    def _add_doubt(self, taylor: Any) -> None:
        """Compare the slope at the start of the last step with that at the end of the one before.

        Where a series goes on beyond the end of a root, no choice differs, and no step gets short.
        """
        series, length = np.asarray(taylor.tc, dtype=np.float64)[:, 1:], float(taylor.last_h)
        order = np.arange(1.0, series.shape[1] + 1.0)
        with np.errstate(all="ignore"):
            if self._arriving is not None:
                slope, before = self._arriving
                self.doubt += before * float(np.max(np.abs(series[:, 0] - slope)))
            self._arriving = series @ (order * length ** (order - 1.0)), length
        self.doubts += [self.doubt] * (len(self.samples) - len(self.doubts))

    def _read_off(self, taylor: Any, target: Any) -> None:
        """Record the samples inside the last step."""
        ts = self.problem.ts
        while (t := ts[len(self.samples)]) < target and t <= taylor.time:
            taylor.update_d_output(self._number(float(t)))
            self.samples.append(taylor.d_output.copy())

    def _keep_parts(self, taylor: Any) -> None:
        """Keep the last step in parts, by its Taylor polynomials."""
        h, end = float(taylor.last_h), float(taylor.time)
        coefficients = np.asarray(taylor.tc, dtype=np.float64).T
        order = np.arange(len(coefficients))
        at = np.arange(_PARTS + 1)[:, None] / _PARTS * h
        with np.errstate(all="ignore"):
            states = at**order @ coefficients
            slopes = at ** order[:-1] @ (order[1:, None] * coefficients[1:])
        times = np.append(end - h + at[1:-1, 0], end)
        before = self.parts[-1][0] if self.parts else self.problem.ts[0]
        apart = np.all(np.diff(times, prepend=before) > 0)
        if apart and np.all(np.isfinite(states)) and np.all(np.isfinite(slopes)):
            self.parts += zip(times, states[1:], slopes[:-1], slopes[1:], strict=True)

    def _look_at_guards(
        self,
        translation: Translation,
        steps: list[tuple[float, np.ndarray]],
        end: float,
        first: int,
    ) -> None:
        """Drop the samples from the first choice that changes on."""
        # At a jump time it may be either.
        inside = [step for step in steps if step[0] < end or end == self.problem.ts[-1]]
        inside = [step for step in inside if np.all(np.isfinite(step[1]))]
        if not inside:
            return
        ts = [t for t, _ in inside]
        states = np.stack([state for _, state in inside]).reshape(-1, *self.problem.y0.shape)
        broken = translation.first_break(ts, states)
        if broken is None:
            return
        index, name = broken
        kept = int(np.searchsorted(self.problem.ts, ts[index]))
        del self.samples[max(kept, first) :]
        self.failure = (
            f"stopped before t = {ts[index]:g}: there {name!r} in the right-hand side takes "
            "another branch than at the start, so that it is not one smooth function"
        )

    def _exactly(self, array: np.ndarray) -> np.ndarray:
        return np.array([self._number(float(entry)) for entry in array])

    def _number(self, value: float) -> Any:
        """A float64 number in the precision of the run, without rounding."""
        if self.precision == HARDWARE and in_hardware():
            return np.longdouble(value)
        return heyoka().real(value, self.precision)

    def _kind(self) -> dict[str, Any]:
        """What heyoka calls numbers of this precision."""
        if self.precision == HARDWARE and in_hardware():
            # Five times as fast to compile, three times as slow to run: most runs are short.
            return {"fp_type": np.longdouble, "opt_level": 0}
        return {"fp_type": heyoka().real, "prec": self.precision}


def in_hardware() -> bool:
    """Whether the processor computes with a significand of 64 bits."""
    return np.finfo(np.longdouble).nmant + 1 == HARDWARE
