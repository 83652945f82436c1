"""A stepper that is to be judged, and its runs."""

from __future__ import annotations

import abc
import dataclasses
import functools
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer

from ropeode.checking.step_signatures import Equations, Form
from ropeode.errors import RopeodeError, UserCodeError
from ropeode.problems.problem import Problem
from ropeode.simulation.trajectory import frame_lengths

# Frames that the compiled loop has room for; more make it compile again.
_CAPACITY = 4


class Candidate(abc.ABC):
    """Something that makes runs of problems.

    Arguments:
        label: what it is called in reports.
        form: how it is called.
        own_forces: it never asks for the acceleration that it is handed, but computes its own
            from `args`; it then knows nothing of the drive.
        equal_frames: it needs one step size for the whole run.
    """

    def __init__(
        self, label: str, form: Form, *, own_forces: bool = False, equal_frames: bool = False
    ):
        self.label = label
        self.form = form
        self.own_forces = own_forces
        self.equal_frames = equal_frames

    @abc.abstractmethod
    def run(self, problem: Problem, steps_per_frame: int) -> np.ndarray:
        """The states at the sample times, ``(times, *state)``.

        From the first sample on whose state is not finite, all are not-a-number.

        Arguments:
            problem: what to solve.
            steps_per_frame: equal steps in each interval between sample times.

        Raises:
            UserCodeError: the user's code raised, or returned something that is no state.
        """

    @abc.abstractmethod
    def first_step(self, problem: Problem, dt: float) -> tuple[Any, Callable[[Any], Any]]:
        """What is carried into the first step, and the step as a function of it.

        Arguments:
            problem: what is solved; the step starts at its first sample time.
            dt: step size.
        """


class Compiled(Candidate):
    """A candidate written in JAX (or in nothing that JAX cannot trace)."""

    def run(self, problem: Problem, steps_per_frame: int) -> np.ndarray:
        """As in `Candidate`."""
        spare = -problem.frames % _CAPACITY
        states = self._loop(Equations.of(problem))(
            problem.args,
            problem.y0,
            np.pad(problem.ts, (0, spare)),
            np.pad(frame_lengths(problem), (0, spare), constant_values=1.0),
            np.int64(problem.frames),
            np.int64(steps_per_frame),
        )
        return finite_part(np.asarray(states)[: problem.frames + 1])

    def first_step(self, problem: Problem, dt: float) -> tuple[Any, Callable[[Any], Any]]:
        """As in `Candidate`."""
        init, step = self._first_step(Equations.of(problem))
        t, args = problem.ts[0], problem.args
        return init(args, t, problem.y0, dt), lambda carried: step(args, t, carried, dt)

    def _first_step(self, equations: Equations) -> tuple[Callable, Callable]:
        if equations not in self._steps:
            methods = (self.form.init, self.form.step)
            self._steps[equations] = tuple(
                jax.jit(functools.partial(method, equations)) for method in methods
            )
        return self._steps[equations]

    @functools.cached_property
    def _steps(self) -> dict[Equations, Any]:
        return {}

    @functools.cached_property
    def _loops(self) -> dict[Equations, Callable]:
        return {}

    def _loop(self, equations: Equations) -> Callable:
        if equations not in self._loops:
            self._loops[equations] = jax.jit(functools.partial(_loop, self.form, equations))
        return self._loops[equations]


def _loop(
    form: Form,
    equations: Equations,
    args: Any,
    y0: Any,
    ts: Any,
    lengths: Any,
    frames: Any,
    steps: Any,
) -> Any:
    """All frames; their number and that of the steps are run-time values."""

    def one_frame(frame: Any, loop: tuple) -> tuple:
        carried, states = loop
        dt = lengths[frame] / steps

        def one_step(i: Any, carried: Any) -> Any:
            return form.step(equations, args, ts[frame] + i * dt, carried, dt)

        carried = jax.lax.fori_loop(0, steps, one_step, carried)
        y = form.state(equations, args, ts[frame + 1], carried, dt)
        return carried, jax.lax.dynamic_update_index_in_dim(states, y, frame + 1, 0)

    dt = lengths[0] / steps
    carried = form.init(equations, args, ts[0], y0, dt)
    states = (
        jnp.zeros((len(ts), *y0.shape)).at[0].set(form.state(equations, args, ts[0], carried, dt))
    )
    return jax.lax.fori_loop(0, frames, one_frame, (carried, states))[1]


class Interpreted(Candidate):
    """A candidate that runs in Python, step by step, on NumPy arrays."""

    def run(self, problem: Problem, steps_per_frame: int) -> np.ndarray:
        """As in `Candidate`."""
        equations = in_numpy(Equations.of(problem))
        args = jax.tree.map(np.array, problem.args)
        states = np.full((problem.frames + 1, *problem.y0.shape), np.nan)
        with np.errstate(all="ignore"):
            self._fill(states, equations, args, problem, steps_per_frame)
        return finite_part(states)

    def first_step(self, problem: Problem, dt: float) -> tuple[Any, Callable[[Any], Any]]:
        """As in `Candidate`."""
        equations, t, dt = in_numpy(Equations.of(problem)), float(problem.ts[0]), float(dt)
        args = jax.tree.map(np.array, problem.args)

        def step(carried: Any) -> Any:
            # A copy: a user's step may write to what it is given.
            given = jax.tree.map(np.array, carried)
            return called(self.form.step, equations, args, t, given, dt)

        return called(self.form.init, equations, args, t, problem.y0.copy(), dt), step

    def _fill(
        self, states: np.ndarray, equations: Equations, args: Any, problem: Problem, steps: int
    ) -> None:
        # Plain numbers: those of NumPy multiply a `Phase` as if it were an array.
        form, ts = self.form, problem.ts.tolist()
        lengths = frame_lengths(problem).tolist()

        def users(function: Callable, t: float, given: Any, dt: float) -> Any:
            return called(function, equations, args, t, given, dt)

        # The problem's own arrays stay as they are, whatever is done to these.
        carried = users(form.init, ts[0], problem.y0.copy(), lengths[0] / steps)
        states[0] = users(form.state, ts[0], carried, lengths[0] / steps)
        for frame in range(problem.frames):
            start, dt = ts[frame], lengths[frame] / steps
            for i in range(steps):
                carried = users(form.step, start + i * dt, carried, dt)
            y = users(form.state, ts[frame + 1], carried, dt)
            if not np.all(np.isfinite(y)):
                return
            states[frame + 1] = y


def called(function: Callable, *given: Any) -> Any:
    """Call what may be a user's; what it raises becomes the cause of a `UserCodeError`."""
    try:
        return function(*given)
    except RopeodeError:
        raise
    except (Exception, SystemExit) as error:
        raise UserCodeError(
            f"step: it raised {type(error).__name__}: {' '.join(str(error).split())}; allowed: "
            "code that runs. Fix: mend the error above."
        ) from error


def finite_part(states: np.ndarray) -> np.ndarray:
    """The states, not-a-number from the first one on that is not finite."""
    finite = np.all(np.isfinite(states.reshape(len(states), -1)), axis=1)
    if np.all(finite):
        return states
    states = states.copy()
    states[int(np.argmin(finite)) :] = np.nan
    return states


@functools.lru_cache(maxsize=16)
def in_numpy(equations: Equations) -> Equations:
    """The same functions, which take NumPy arrays and return them.

    Inside a loop of JAX's own they are traced, as such a loop wants it.
    """
    acceleration = equations.acceleration
    if acceleration is None or equations.mechanics is None:
        return Equations(_in_numpy(equations.rhs), None, None)
    own = _in_numpy(acceleration)

    def rhs(t: Any, y: Any, args: Any) -> Any:
        return (jnp if isinstance(y, Tracer) else np).stack([y[1], own(t, y[0], y[1], args)])

    mechanics = dataclasses.replace(equations.mechanics, acceleration=own)
    return Equations(rhs, own, mechanics)


def _in_numpy(function: Callable) -> Callable:
    compiled = jax.jit(function)

    def plain(*given: Any) -> Any:
        found = compiled(*given)
        # A copy: what JAX hands out must not be written to.
        return found if isinstance(found, Tracer) else np.array(found)

    return functools.wraps(function)(plain)
