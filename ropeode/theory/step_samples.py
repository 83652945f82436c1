"""Values of a stepper's map at many states and step sizes, whatever the step is written in."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ropeode.precision import in_float64
from ropeode.problems.problem import Mechanics, Problem, Rhs
from ropeode.problems.python_rhs import PythonRhs
from ropeode.simulation.method import Method
from ropeode.simulation.python_driver import PythonStepper, one_at_a_time
from ropeode.simulation.system import on_stored_states
from ropeode.simulation.user_clock import on_user_clock
from ropeode.steppers.base import Stepper

# A compiled program takes so many cases at once; the last of them are repeated to fill it.
_BATCH = 512


class StepSamples:
    """The map ``(t, y, dt) -> state after n steps``, for several n at once.

    Arguments:
        problem: that the steps are made on.
        method: the stepper.
    """

    def __init__(self, problem: Problem, method: Method):
        self.problem, self._method = problem, method
        self._rates = _rates(problem)

    def rates(self, t: np.ndarray, y: np.ndarray) -> np.ndarray:
        """The right-hand side: times ``(cases,)``, states ``(cases, *state)``."""
        return self._rates(t, y)

    @property
    def carries_state(self) -> bool:
        """Whether a step is a function of state, time and step size by the way it is written."""
        own = type(self._method.stepper)
        return own.init is Stepper.init and own.state is Stepper.state

    @in_float64
    def after(self, t: np.ndarray, y: np.ndarray, dt: np.ndarray, steps: int) -> np.ndarray:
        """The states after 0, 1, ..., `steps` steps, as the stepper hands them out.

        Arguments:
            t: times, ``(states,)``.
            y: states, ``(states, *state)``.
            dt: step sizes for each, ``(states, sizes)``.
            steps: how many.

        Returns:
            ``(states, sizes, steps + 1, *state)``.

        Raises:
            UserCodeError: the step raised.
        """
        stepper, problem, sizes = self._method.stepper, self.problem, dt.shape[1]
        cases = np.repeat(t, sizes), np.repeat(y, sizes, axis=0), dt.ravel()
        if self._method.trial.compiled:
            run = _compiled(stepper, problem.rhs, problem.mechanics, steps)
            states = in_batches(lambda *each: on_user_clock(run, problem.args, *each), cases)
        else:
            own = PythonStepper(problem, stepper)
            with one_at_a_time(), np.errstate(all="ignore"):
                lines = zip(cases[0].tolist(), cases[1], cases[2].tolist(), strict=True)
                states = np.stack([_in_python(own, *line, steps) for line in lines])
        return states.reshape(*dt.shape, steps + 1, *y.shape[1:])


def in_batches(function: Callable[..., Any], cases: tuple[np.ndarray, ...]) -> np.ndarray:
    """A function of many cases, called with one number of them, so that it is compiled once.

    Arguments:
        function: of arrays with a leading axis of `_BATCH` cases.
        cases: arrays with a leading axis of any number of cases, at least one.
    """
    count = len(cases[0])
    results = []
    for first in range(0, count, _BATCH):
        index = np.minimum(np.arange(first, first + _BATCH), count - 1)
        results.append(np.asarray(function(*(each[index] for each in cases))))
    return np.concatenate(results)[:count]


def _in_python(own: PythonStepper, t: float, y: np.ndarray, dt: float, steps: int) -> np.ndarray:
    carried = on_user_clock(own.init, t, y, dt)
    states = [np.array(on_user_clock(own.state, t, carried, dt))]
    for i in range(steps):
        carried = on_user_clock(own.step, t + i * dt, carried, dt)
        states.append(np.array(on_user_clock(own.state, t + (i + 1) * dt, carried, dt)))
    return np.stack(states)


def _rates(problem: Problem) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    rhs, args = problem.rhs, problem.args
    if isinstance(rhs, PythonRhs):
        return lambda t, y: np.stack(
            [rhs.in_numpy(one_t, one_y, args) for one_t, one_y in zip(t, y, strict=True)]
        )
    every = _every_rate(rhs)
    return in_float64(lambda t, y: in_batches(lambda t, y: every(t, y, args), (t, y)))


@functools.lru_cache(maxsize=64)
def _every_rate(rhs: Rhs) -> Callable:
    return jax.jit(jax.vmap(rhs, in_axes=(0, 0, None)))


@functools.lru_cache(maxsize=64)
def _compiled(stepper: Stepper, rhs: Rhs, mechanics: Mechanics | None, steps: int) -> Callable:
    """The states after each number of steps, compiled for many cases at once."""
    init, step, state = on_stored_states(stepper, rhs, mechanics)

    def run(args: Any, t: Any, y: Any, dt: Any) -> Any:
        carried = init(args, t, y, dt)

        def advance(carried: Any, i: Any) -> tuple[Any, Any]:
            now = t + i * dt
            return step(args, now, carried, dt), state(args, now, carried, dt)

        carried, states = jax.lax.scan(advance, carried, jnp.arange(steps, dtype=float))
        last = state(args, t + steps * dt, carried, dt)
        return jnp.concatenate([states, last[None]])

    return jax.jit(jax.vmap(run, in_axes=(None, 0, 0, 0)))
