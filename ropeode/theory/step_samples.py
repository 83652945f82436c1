"""Values of a stepper's map at many states and step sizes, whatever the step is written in."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jax.scipy.sparse.linalg import cg

from ropeode.precision import in_float64
from ropeode.problems import Mechanics, Problem, PythonRhs, Rhs, for_each_state
from ropeode.simulation import (
    Method,
    PythonStepper,
    flattened,
    on_stored_states,
    on_user_clock,
    one_at_a_time,
)
from ropeode.steppers import BuiltIn, Stepper

# A compiled program takes so many cases at once, of slopes and of steps, which may each solve
# equations; the last of them are repeated to fill it.
_BATCH, _STEPS_AT_ONCE = 512, 64
# It makes up to so many steps, or as many as are wanted if these are more; for a stepper that
# carries nothing but the state one is enough.
_MOST = 10
# Newton steps by which what is carried is settled to a state, and the disturbance, beside the
# largest number, by which its slopes are found in Python.
_CORRECTIONS, _NUDGE = 3, 1e-6
# Of the conjugate gradients that each of them takes in JAX.
_TOLERANCE, _MOST_ITERATIONS = 1e-9, 30


class StepSamples:
    """The map ``(t, y, dt) -> state after n steps``, for several n at once.

    Arguments:
        problem: that the steps are made on.
        method: the stepper.
        settled: whether what is carried at the start is corrected by as little as possible such
            that the stepper hands out the state that it starts from. A method with memory whose
            own start is meant for one state only can so be looked at from any state.
        nodes_first: whether states are ``(2, nodes, dim)`` here, however the problem stores them.
    """

    def __init__(
        self, problem: Problem, method: Method, settled: bool = False, nodes_first: bool = False
    ):
        self.problem, self._method, self._settled = problem, method, settled
        self._rates, self._nodes_first = rates_of(problem), nodes_first

    def rates(self, t: np.ndarray, y: np.ndarray) -> np.ndarray:
        """The right-hand side: times ``(cases,)``, states ``(cases, *state)``."""
        return self.turned(self._rates(t, self.turned(y)))

    def turned(self, states: np.ndarray) -> np.ndarray:
        """States as the problem stores them from those here, and the other way round."""
        mechanics = self.problem.mechanics
        turn = self._nodes_first and mechanics is not None and mechanics.node_axis == 1
        return np.swapaxes(states, -2, -1) if turn else states

    @property
    def carries_state(self) -> bool:
        """Whether a step is a function of state, time and step size by the way it is written."""
        own = type(self._method.stepper)
        return own.init is Stepper.init and own.state is Stepper.state

    @property
    def may_begin(self) -> bool:
        """Whether it may begin as another method than it goes on as: those of ropeode do not."""
        return not (self.carries_state or isinstance(self._method.stepper, BuiltIn))

    def with_nodes_first(self) -> StepSamples:
        """The same with states ``(2, nodes, dim)``, however a mechanical problem stores them."""
        return StepSamples(self.problem, self._method, self._settled, nodes_first=True)

    def on(self, problem: Problem) -> StepSamples:
        """The same of another problem."""
        return StepSamples(problem, self._method, self._settled, self._nodes_first)

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
        cases = np.repeat(t, sizes), np.repeat(self.turned(y), sizes, axis=0), dt.ravel()
        if self._method.trial.compiled:
            most = max(steps, 1 if self.carries_state else _MOST)
            run = _compiled(stepper, problem.rhs, problem.mechanics, most, self._settled)
            states = in_batches(
                lambda *each: on_user_clock(run, problem.args, *each, steps), cases, _STEPS_AT_ONCE
            )
            states = states[:, : steps + 1]
        else:
            own = PythonStepper(problem, stepper)
            with one_at_a_time(), np.errstate(all="ignore"):
                lines = zip(cases[0].tolist(), cases[1], cases[2].tolist(), strict=True)
                states = np.stack([_in_python(own, *line, steps, self._settled) for line in lines])
        return self.turned(states.reshape(*dt.shape, *states.shape[1:]))


def in_batches(
    function: Callable[..., Any], cases: tuple[np.ndarray, ...], batch: int = _BATCH
) -> Any:
    """A function of many cases, called with one number of them, so that it is compiled once.

    Arguments:
        function: of arrays with a leading axis of `batch` cases; its result has one too, or is a
            pytree of such.
        cases: arrays with a leading axis of any number of cases, at least one.
        batch: that number.
    """
    count = len(cases[0])
    results = []
    for first in range(0, count, batch):
        index = np.minimum(np.arange(first, first + batch), count - 1)
        results.append(function(*(each[index] for each in cases)))
    return jax.tree.map(lambda *each: np.concatenate(each)[:count], *results)


def _in_python(
    own: PythonStepper, t: float, y: np.ndarray, dt: float, steps: int, settled: bool
) -> np.ndarray:
    carried = on_user_clock(own.init, t, y, dt)
    if settled:
        state = functools.partial(on_user_clock, own.state, t)
        carried = _settled_in_python(lambda carried: state(carried, dt), carried, y)
    states = [np.array(on_user_clock(own.state, t, carried, dt))]
    for i in range(steps):
        carried = on_user_clock(own.step, t + i * dt, carried, dt)
        states.append(np.array(on_user_clock(own.state, t + (i + 1) * dt, carried, dt)))
    return np.stack(states)


def _settled_in_jax(state: Callable[[Any], Any], carried: Any, y: Any, weight: Any) -> Any:
    """What is carried, corrected so that its state is `y`: Newton's method, of least norm.

    Arguments:
        state: of what is carried.
        carried: any pytree, of which numbers in floating point are corrected.
        y: the state.
        weight: of each component, flat. Velocities may be differences of positions over dt; times
            dt they are of the size of positions.
    """
    numbers, others = eqx.partition(carried, eqx.is_inexact_array)
    flat, unravel = ravel_pytree(numbers)

    def away(flat: Any) -> Any:
        return jnp.ravel(state(eqx.combine(unravel(flat), others)) - y)

    for _ in range(_CORRECTIONS):
        rest, forward = jax.linearize(away, flat)
        backward = jax.linear_transpose(forward, flat)

        def normal(w: Any, forward: Any = forward, backward: Any = backward) -> Any:
            return weight * forward(*backward(weight * w))

        w, _ = cg(normal, weight * rest, tol=_TOLERANCE, maxiter=_MOST_ITERATIONS)
        flat = flat - backward(weight * w)[0]
    return eqx.combine(unravel(flat), others)


def _settled_in_python(state: Callable[[Any], Any], carried: Any, y: np.ndarray) -> Any:
    """As `_settled_in_jax`, with difference quotients."""
    flat, unravel = flattened(carried)

    def away(flat: np.ndarray) -> np.ndarray:
        return np.ravel(np.asarray(state(unravel(flat))) - y)

    rest, nudge = away(flat), _NUDGE * float(np.max(np.abs([*flat, *y.ravel()])))
    if not rest.any() or not nudge:
        return carried
    slopes = np.stack(
        [(away(flat + nudge * unit) - rest) / nudge for unit in np.eye(flat.size)], axis=1
    )
    # Rows of one size: velocities may be differences of positions over dt.
    size = np.maximum(np.linalg.norm(slopes, axis=1), np.finfo(float).tiny)
    for _ in range(_CORRECTIONS):
        flat = flat - np.linalg.lstsq(slopes / size[:, None], away(flat) / size)[0]
    return unravel(flat)


def rates_of(problem: Problem, args: Any = None) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    """The right-hand side of many cases: times ``(cases,)``, states ``(cases, *state)``.

    Arguments:
        problem: that it belongs to.
        args: in place of those of the problem.
    """
    rhs, args = problem.rhs, problem.args if args is None else args
    if isinstance(rhs, PythonRhs):
        return lambda t, y: np.stack(
            [rhs.in_numpy(one_t, one_y, args) for one_t, one_y in zip(t, y, strict=True)]
        )
    every = for_each_state(rhs)
    return in_float64(lambda t, y: in_batches(lambda t, y: every(t, y, args), (t, y)))


@functools.lru_cache(maxsize=64)
def _compiled(
    stepper: Stepper, rhs: Rhs, mechanics: Mechanics | None, most: int, settled: bool
) -> Callable:
    """The states after each number of steps, compiled once for many cases and for all numbers."""
    init, step, state = on_stored_states(stepper, rhs, mechanics)

    def run(args: Any, t: Any, y: Any, dt: Any, steps: Any) -> Any:
        carried = init(args, t, y, dt)
        if settled:
            weight = jnp.ones_like(y) if mechanics is None else jnp.ones_like(y).at[1].set(dt)
            carried = _settled_in_jax(
                lambda carried: state(args, t, carried, dt), carried, y, weight.ravel()
            )

        def advance(i: Any, progress: tuple[Any, Any]) -> tuple[Any, Any]:
            carried, states = progress
            carried = step(args, t + i * dt, carried, dt)
            after = state(args, t + (i + 1) * dt, carried, dt)
            return carried, states.at[i + 1].set(after)

        states = jnp.zeros((most + 1, *y.shape)).at[0].set(state(args, t, carried, dt))
        if most == 1:
            # Without the loop, which takes longer to compile.
            return advance(0, (carried, states))[1]
        return jax.lax.fori_loop(0, steps, advance, (carried, states))[1]

    return jax.jit(jax.vmap(run, in_axes=(None, 0, 0, 0, None)))
