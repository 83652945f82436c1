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
from ropeode.simulation.system import as_seen, as_stored, system
from ropeode.steppers.base import BuiltIn, Stepper

# Of the size of a component: where truncation and rounding of a difference of fourth order meet.
_H = 1e-3


class StepMap:
    """The first step of a stepper on a problem, at any step size.

    What is carried is seen as one vector of its floating-point numbers.

    Arguments:
        problem: what is solved.
        method: the stepper, ready to run on it.
    """

    def __init__(self, problem: Problem, method: Method):
        stepper, self.exact = method.stepper, method.trial.compiled
        self._problem, mechanics = problem, problem.mechanics
        nodes_first = not stepper.any_layout
        self._turned = nodes_first and mechanics is not None and mechanics.node_axis == 1
        if self.exact:
            find = _compiled if isinstance(stepper, BuiltIn) else _compiled.__wrapped__
            self._start, self._step, self._state, self._derivative = find(
                stepper, problem.rhs, problem.mechanics
            )
        else:
            own = PythonStepper(problem, stepper)
            self._start = lambda args, t, y, dt: own.init(float(t), y, float(dt))
            self._step = lambda args, t, carried, dt: own.step(
                float(t), jax.tree.map(np.array, carried), float(dt)
            )
            self._state = lambda args, t, carried, dt: own.state(float(t), carried, float(dt))

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
        carried = self._start(self._problem.args, self._problem.ts[0], y, dt)
        return jax.tree.map(np.array, carried)

    @in_float64
    def first_sample(self, y: np.ndarray, dt: float) -> np.ndarray:
        """The state at the start, as the stepper hands it out before the first step."""
        problem = self._problem
        carried = self._start(problem.args, problem.ts[0], y, dt)
        return np.array(self._state(problem.args, problem.ts[0], carried, dt))

    @in_float64
    def step(self, carried: Any, dt: float) -> Any:
        """What is carried after a step, as NumPy arrays."""
        after = self._step(self._problem.args, self._problem.ts[0], carried, dt)
        return jax.tree.map(np.array, after)

    @in_float64
    def derivative(self, carried: Any, dt: float, moving: np.ndarray) -> np.ndarray:
        """The derivative of a step, ``(moving numbers, moving numbers)``.

        By automatic differentiation; of a step in Python by central differences of fourth order.

        Arguments:
            carried: where.
            dt: step size.
            moving: which numbers of what is carried can move, ``(numbers,)``.
        """
        flat, unravel = ravel_pytree(carried)
        if self.exact:
            problem = self._problem
            whole = np.asarray(self._derivative(problem.args, problem.ts[0], carried, dt))
            return whole[moving][:, moving]
        flat = np.array(flat)
        h = _H * max(float(np.max(np.abs(flat), initial=0.0)), np.finfo(np.float64).tiny)

        def after(index: Any, distance: float) -> np.ndarray:
            near = flat.copy()
            near[index] += distance
            return np.asarray(ravel_pytree(self.step(unravel(jnp.asarray(near)), dt))[0])[moving]

        columns = [
            (8.0 * (after(i, h) - after(i, -h)) - (after(i, 2 * h) - after(i, -2 * h))) / (12.0 * h)
            for i in np.flatnonzero(moving)
        ]
        return np.stack(columns, axis=1)


@functools.lru_cache(maxsize=64)
def _compiled(
    stepper: Stepper, rhs: Rhs, mechanics: Mechanics | None
) -> tuple[Callable, Callable, Callable, Callable]:
    """Start, step, sample and the step's derivative: ``(args, t, y or what is carried, dt)``."""
    nodes_first = not stepper.any_layout

    def bound(args: Any) -> Any:
        return system(rhs, mechanics, args, nodes_first=nodes_first)

    def start(args: Any, t: Any, y: Any, dt: Any) -> Any:
        return stepper.init(bound(args), t, as_seen(y, mechanics, nodes_first), dt)

    def step(args: Any, t: Any, carried: Any, dt: Any) -> Any:
        return stepper.step(bound(args), t, carried, dt)

    def state(args: Any, t: Any, carried: Any, dt: Any) -> Any:
        y = stepper.state(bound(args), t, carried, dt)
        return as_stored(y, mechanics, nodes_first)

    def derivative(args: Any, t: Any, carried: Any, dt: Any) -> Any:
        flat, unravel = ravel_pytree(carried)
        return jax.jacfwd(lambda flat: ravel_pytree(step(args, t, unravel(flat), dt))[0])(flat)

    return jax.jit(start), jax.jit(step), jax.jit(state), jax.jit(derivative)
