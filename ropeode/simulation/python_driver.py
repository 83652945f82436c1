"""The driver for steppers that JAX cannot trace: step by step, in Python, on NumPy arrays."""

from __future__ import annotations

import contextlib
import functools
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import jax
import numpy as np

from ropeode.errors import UserCodeError, call_user_code
from ropeode.problems import Problem
from ropeode.progress import Progress
from ropeode.simulation.jumps import intervals, own_side, sides
from ropeode.simulation.system import as_seen, as_stored, is_turned, system
from ropeode.simulation.time_needed import TimeNeeded
from ropeode.simulation.trajectory import Iterations
from ropeode.simulation.user_clock import on_user_clock
from ropeode.steppers import Stepper, System

# How soon a thread that waits for its turn notices that it was taken from another one.
_LOOKS_AGAIN_S = 0.1
# From states so many times larger than the problem, a step that raises has diverged: unlike NumPy's
# numbers, Python's overflow with an exception.
_HUGE = 1e30


class _Turn:
    """Whose turn it is to run a user's step."""

    def __init__(self) -> None:
        self.lock = threading.RLock()
        self.thread: int | None = None


_turn = _Turn()


@contextlib.contextmanager
def one_at_a_time() -> Iterator[None]:
    """Wait for a turn: a user's step may write to arrays of its own, the same in all threads."""
    while True:
        turn = _turn
        if turn.lock.acquire(timeout=_LOOKS_AGAIN_S):
            if turn is _turn:
                break
            turn.lock.release()
    try:
        turn.thread = threading.get_ident()
        yield
    finally:
        turn.lock.release()


def take_turn_from(thread: int) -> None:
    """Let others run, where a thread that hangs in compiled code has the turn and keeps it."""
    global _turn
    if _turn.thread == thread:
        _turn = _Turn()


class PythonStepper:
    """The three functions of a stepper on one problem, with numbers and NumPy arrays."""

    def __init__(self, problem: Problem, stepper: Stepper):
        self.problem, self.calls = problem, 0
        self._stepper = stepper
        self._turned = is_turned(stepper, problem.mechanics)
        self._sides = sides(problem)
        self._seen = own_side(self._sides, float(problem.ts[0]))
        self.system: System = system(
            problem.rhs,
            problem.mechanics,
            # The problem's own arrays stay as they are, whatever a step does to these.
            jax.tree.map(np.array, problem.args),
            counted=self._counted,
            turned=self._turned,
            in_numpy=True,
        )

    def _counted(self, function: Callable) -> Callable:
        @functools.wraps(function)
        def call(t: Any, *given: Any) -> Any:
            self.calls += 1
            return function(self._seen(t), *given)

        return call

    def compile_right_hand_side(self, t: float) -> None:
        """Evaluate it once."""
        equations = self.system.equations
        equations.rhs(
            t, as_seen(self.problem.y0, self.problem.mechanics, self._turned), equations.args
        )

    def init(self, t: float, y: np.ndarray, dt: float) -> Any:
        """What is carried into the first step, from a state ``(*state,)``."""
        start = as_seen(y, self.problem.mechanics, self._turned)
        # Copies, in the order of memory that a step which reshapes them expects.
        start = jax.tree.map(lambda half: np.array(half, order="C"), start)
        return self._called(self._stepper.init, t, start, dt)

    def step(self, t: float, carried: Any, dt: float) -> Any:
        """What is carried at ``t + dt``."""
        return self._called(self._stepper.step, t, carried, dt)

    def state(self, t: float, carried: Any, dt: float) -> np.ndarray:
        """The state at time `t`, as the problem has it."""
        y = self._called(self._stepper.state, t, carried, dt, ahead=-0.5)
        if not self.system.mechanical:
            return np.asarray(y)
        halves = [np.asarray(half) for half in y]
        return as_stored(halves, self.problem.mechanics, self._turned)

    def iterations(self, carried: Any) -> Iterations:
        """What the stepper says of them."""
        jacobians = self._stepper.jacobian_evaluations(carried)
        return Iterations(bool(np.all(self._stepper.solved(carried))), int(jacobians or 0))

    def _called(
        self, function: Callable, t: float, given: Any, dt: float, ahead: float = 0.5
    ) -> Any:
        """Call a method, so many steps before the middle of its step."""
        self._seen = own_side(self._sides, t + ahead * dt)
        return call_user_code("step", function, self.system, t, given, dt)


def _has_blown_up(carried: Any, scale: float) -> bool:
    """Whether a number carried is not finite, or so huge that Python's arithmetic may raise."""
    leaves = [np.asarray(leaf) for leaf in jax.tree.leaves(carried)]
    numbers = [leaf for leaf in leaves if np.issubdtype(leaf.dtype, np.floating)]
    return any(not np.all(np.abs(leaf) <= _HUGE * scale) for leaf in numbers)


def run_in_python(
    problem: Problem, stepper: Stepper, steps_per_frame: int, longest: float, progress: Progress
) -> tuple[np.ndarray, int, int, Iterations]:
    """Run a stepper over all frames of a problem; it ends at the first state that is not finite.

    Arguments:
        problem: to be solved.
        stepper: with which.
        steps_per_frame: equal steps.
        longest: seconds that it may take.
        progress: called with the stepper's label and the fraction that is done.

    Returns:
        States at the sample times, ``(times, *state)``, not-a-number behind the last frame; the
        last frame that was run; the calls of the right-hand side; what the stepper said of its
        iterations.

    Raises:
        InputError: it would take longer, as its first steps show.
        UserCodeError: the step raised, other than from a state that had grown huge, or returned
            something that is no state.
    """
    own = PythonStepper(problem, stepper)
    times, lengths, fresh, samples = (each.tolist() for each in intervals(problem))
    states = np.full((problem.frames + 1, *problem.y0.shape), np.nan)

    def run() -> tuple[int, Iterations]:
        y, carried, said = problem.y0, None, Iterations(True, 0)
        states[0], frame, done, began = y, 0, 0, time.perf_counter()
        needed = TimeNeeded(longest, steps_per_frame, len(lengths))

        def iterations() -> Iterations:
            return said.and_then(own.iterations(carried))

        for each, length in enumerate(lengths):
            start, dt = times[each], length / steps_per_frame
            try:
                if fresh[each]:
                    said = iterations() if each else said
                    carried = own.init(start, y, dt)
                for i in range(steps_per_frame):
                    carried = own.step(start + i * dt, carried, dt)
                    done += 1
                    # From one power of two to the next.
                    if not (needed.known or done & (done - 1)):
                        now = time.perf_counter()
                        needed.tried(max(done // 2, 1), now - began)
                        began = now
                y = own.state(times[each + 1], carried, dt)
            except UserCodeError:
                if not _has_blown_up(carried, problem.scale):
                    raise
                return frame + 1, iterations()
            progress(stepper.label, (each + 1) / len(lengths))
            if not np.all(np.isfinite(y)):
                return frame + 1, iterations()
            if each + 1 == samples[frame + 1]:
                frame += 1
                states[frame] = y
        return frame, iterations()

    with one_at_a_time(), np.errstate(all="ignore"):
        last, iterations = on_user_clock(run)
    return states, last, own.calls, iterations
