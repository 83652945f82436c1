"""One step as a map of what is carried: for eigenvalues, whatever the step is written in."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree

from ropeode.precision import in_float64
from ropeode.problems.problem import Mechanics, Problem, Rhs
from ropeode.simulation.method import Method
from ropeode.simulation.python_driver import PythonStepper
from ropeode.simulation.system import is_turned, on_stored_states
from ropeode.simulation.user_clock import on_user_clock
from ropeode.steppers.base import BuiltIn, Stepper

# Differences of eighth order (Fornberg, Math. Comp. 51 (1988), table 1): how far apart, as a part
# of the size of a state, and the weights. Nodes a hundredth of that size apart, whose forces change
# as quickly, then spoil it no more than rounding does.
_H = 2.0**-12
_WEIGHTS = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}


class StepMap:
    """The first step of a stepper on a problem, at any step size.

    What is carried is seen as one vector of its floating-point numbers.
    """

    def __init__(self, problem: Problem, method: Method):
        stepper, self.exact = method.stepper, method.trial.compiled
        self._turned = is_turned(stepper, problem.mechanics)
        self._scale = problem.scale
        if self.exact:
            what = stepper, problem.rhs, problem.mechanics
            own = isinstance(stepper, BuiltIn)
            functions = _compiled(*what) if own else map(_Compiled, _functions(*what))
            at_start: tuple[Any, ...] = problem.args, problem.ts[0]
        else:
            own = PythonStepper(problem, stepper)
            functions = [
                functools.partial(on_user_clock, function)
                for function in (own.init, own.step, own.state)
            ]
            at_start = (float(problem.ts[0]),)
        bound = [functools.partial(function, *at_start) for function in functions]
        self._init, self._step, self._state = bound[:3]
        self._derivative = bound[3] if self.exact else None

    def moving(self, carried: Any, free: np.ndarray) -> np.ndarray:
        """Which numbers of what is carried can move, ``(numbers,)``.

        Arguments:
            carried: as `start` gives it.
            free: which coordinates of the problem's positions can; in their shape.
        """
        free = free.T if self._turned else free
        return np.concatenate(
            [
                (
                    np.broadcast_to(free, leaf.shape)
                    if leaf.shape[-free.ndim :] == free.shape
                    else np.ones(leaf.shape, dtype=bool)
                ).ravel()
                # What counts, and is no number that could be disturbed, stays as it is.
                & np.issubdtype(leaf.dtype, np.floating)
                for leaf in jax.tree.leaves(carried)
            ]
        )

    @in_float64
    def start(self, y: np.ndarray, dt: float) -> Any:
        """What is carried into the first step from a state, as NumPy arrays."""
        return jax.tree.map(np.array, self._init(y, dt))

    @in_float64
    def first_sample(self, y: np.ndarray, dt: float) -> np.ndarray:
        """The state at the start, as the stepper hands it out before the first step."""
        return np.array(self._state(self._init(y, dt), dt))

    @in_float64
    def step(self, carried: Any, dt: float) -> Any:
        """What is carried after a step, as NumPy arrays."""
        # A step in Python may write to what it is handed.
        return jax.tree.map(np.array, self._step(jax.tree.map(np.array, carried), dt))

    @in_float64
    def derivative(self, carried: Any, dt: float, moving: np.ndarray) -> np.ndarray:
        """The derivative of a step, ``(moving numbers, moving numbers)``.

        By automatic differentiation; of a step in Python by central differences of eighth order.

        Arguments:
            carried, dt: where, and how long the step is.
            moving: which numbers of what is carried can move, ``(numbers,)``.
        """
        if self._derivative is not None:
            return np.asarray(self._derivative(carried, dt))[moving][:, moving]
        flattened, unravel = ravel_pytree(carried)
        flat = np.array(flattened)
        # Where all is zero, of the size that the problem has elsewhere.
        h = _H * max(float(np.max(np.abs(flat), initial=0.0)), self._scale)

        def after(index: Any, distance: float) -> np.ndarray:
            near = flat.copy()
            near[index] += distance
            return np.asarray(ravel_pytree(self.step(unravel(jnp.asarray(near)), dt))[0])[moving]

        columns = [
            sum(w * (after(i, k * h) - after(i, -k * h)) for k, w in _WEIGHTS.items()) / h
            for i in np.flatnonzero(moving)
        ]
        return np.stack(columns, axis=1)


class _Compiled:
    """A function of a user's stepper, compiled before the user's clock runs."""

    def __init__(self, function: Callable):
        self._jitted = jax.jit(function)
        self._compiled: Callable | None = None

    def __call__(self, *given: Any) -> Any:
        # All calls are about one problem, and so of the same shapes.
        if self._compiled is None:
            self._compiled = self._jitted.lower(*given).compile()
        return on_user_clock(jax.block_until_ready, on_user_clock(self._compiled, *given))


@functools.lru_cache(maxsize=64)
def _compiled(
    stepper: Stepper, rhs: Rhs, mechanics: Mechanics | None
) -> tuple[Callable, Callable, Callable, Callable]:
    init, step, state, derivative = _functions(stepper, rhs, mechanics)
    return jax.jit(init), jax.jit(step), jax.jit(state), jax.jit(derivative)


def _functions(
    stepper: Stepper, rhs: Rhs, mechanics: Mechanics | None
) -> tuple[Callable, Callable, Callable, Callable]:
    """Start, step, sample and the step's derivative: ``(args, t, y or what is carried, dt)``."""
    init, step, state = on_stored_states(stepper, rhs, mechanics)

    def derivative(args: Any, t: Any, carried: Any, dt: Any) -> Any:
        flat, unravel = ravel_pytree(carried)

        def after(flat: Any) -> Any:
            return ravel_pytree(step(args, t, unravel(flat), dt))[0]

        try:
            return jax.jacfwd(after)(flat)
        except TypeError:
            # Loops of diffrax can be differentiated backwards only.
            return jax.jacrev(after)(flat)

    return init, step, state, derivative
