"""The result of one run of an adaptive solver, and how long it takes."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Sequence

import numpy as np

from ropeode.references.solvers.solver import Solver


@dataclasses.dataclass(frozen=True, eq=False)
class Path:
    """The steps of a run.

    Arguments:
        times: of their ends, increasing, ``(steps + 1,)``.
        states: there, flat, ``(steps + 1, numbers)``.
        slopes: at the start and at the end of each step, ``(steps, 2, numbers)``.
    """

    times: np.ndarray
    states: np.ndarray
    slopes: np.ndarray

    @classmethod
    def of(cls, start: float, state: np.ndarray, steps: Sequence[tuple]) -> Path:
        """A path from its start and the time, state, and slopes (before, after) of each step."""
        times, states, before, after = zip(*steps, strict=True) if steps else ((), (), (), ())
        slopes = np.reshape([before, after], (2, len(steps), len(state)))
        return cls(np.array([start, *times]), np.stack([state, *states]), slopes.swapaxes(0, 1))

    def until(self, time: float) -> Path:
        """The steps up to a time."""
        count = int(np.searchsorted(self.times, time, side="right"))
        return Path(self.times[:count], self.states[:count], self.slopes[: count - 1])


@dataclasses.dataclass(frozen=True, eq=False)
class Solution:
    """One run of an adaptive solver.

    Arguments:
        solver: which one.
        rtol: relative tolerance.
        atol: absolute tolerance, in the units of the state: one number, or one per component.
        states: ``(times, *state)`` at the sample times that were reached, none interpolated.
        steps: how many (diffrax counts rejected ones, SciPy does not).
        seconds: to run.
        compile_seconds: to compile; 0 if the program was compiled before.
        failure: why it did not reach the last sample time; None if it did.
        reached: the time that it came to.
        ran_out: it stopped because its steps or its time were spent.
        path: its steps, where the solver keeps them.
        rhs_evaluations: of the right-hand side; None where nobody counts them.
        jacobian_evaluations: of its Jacobian; likewise.
    """

    solver: Solver
    rtol: float
    atol: float | np.ndarray
    states: np.ndarray
    steps: int
    seconds: float
    compile_seconds: float = 0.0
    failure: str | None = None
    reached: float = np.inf
    ran_out: bool = False
    path: Path | None = None
    rhs_evaluations: int | None = None
    jacobian_evaluations: int | None = None

    def without_states(self) -> Solution:
        """The run without the memory that its states take."""
        return dataclasses.replace(self, states=np.empty((0, *self.states.shape[1:])), path=None)


def finite_samples(states: np.ndarray) -> int:
    """How many leading samples are finite."""
    finite = np.all(np.isfinite(states.reshape(len(states), -1)), axis=1)
    return len(states) if np.all(finite) else int(np.argmin(finite))


class Stopwatch:
    """Seconds since it was made: by the wall clock, or of the processor if these are fewer.

    So other programs on the same machine take nothing from a run's time, nor do the other threads
    of this one.
    """

    def __init__(self) -> None:
        self._began = time.perf_counter(), time.process_time()

    @property
    def seconds(self) -> float:
        """As above."""
        wall, processor = self._began
        return min(time.perf_counter() - wall, time.process_time() - processor)
