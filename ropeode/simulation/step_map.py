"""One step as a map of what is carried: for eigenvalues, whatever the step is written in."""

from __future__ import annotations

import functools
from collections.abc import Callable, Hashable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree

from ropeode.precision import in_float64
from ropeode.problems import Mechanics, Problem, Rhs
from ropeode.simulation.method import Method
from ropeode.simulation.python_driver import PythonStepper
from ropeode.simulation.system import is_turned, on_stored_states
from ropeode.simulation.user_clock import on_user_clock
from ropeode.steppers import BuiltIn, Stepper

# Differences of eighth order (Fornberg, Math. Comp. 51 (1988), table 1): how far apart, as a part
# of the size of a state, and the weights. Nodes a hundredth of that size apart, whose forces change
# as quickly, then spoil it no more than rounding does.
_H = 2.0**-15
_WEIGHTS = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}
# How many steps a user's stepper may take to begin, and those whose derivatives must then be the
# same, to this part of them.
_BEGINNINGS, _AFTER, _SAME = (0, 1, 2, 4, 8, 16), (17, 18), 1e-6


class StepMap:
    """The first step of a stepper on a problem, at any step size.

    What is carried is seen as one vector of its floating-point numbers.
    """

    def __init__(self, problem: Problem, method: Method):
        stepper, self.exact = method.stepper, method.trial.compiled
        self._turned = is_turned(stepper, problem.mechanics)
        self._scale = problem.scale
        if self.exact:
            at_start = problem.args, problem.ts[0]
            functions = _compiled(method, problem.rhs, problem.mechanics)
            bound = [functools.partial(function, *at_start) for function in functions]
            self._derivatives = bound[3:]
        else:
            own = PythonStepper(problem, stepper)
            bound = [
                functools.partial(on_user_clock, function, float(problem.ts[0]))
                for function in (own.init, own.step, own.state)
            ]
        self._init, self._step, self._state = bound[:3]
        own = type(stepper)
        self._may_begin = own.init is not Stepper.init and not isinstance(stepper, BuiltIn)

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

    def beginning(self, y: np.ndarray, dt: float, free: np.ndarray) -> int | None:
        """After how many steps all that follow are the same, as a method that starts as another.

        Arguments:
            y: a state at rest.
            dt: a short step size.
            free: which coordinates of the problem's positions can move.

        Returns:
            None where steps still change after 16.
        """
        if not self._may_begin:
            return 0
        every = [self.start(y, dt)]
        while len(every) <= _AFTER[-1]:
            every.append(self.step(every[-1], dt))

        def derivative(steps: int) -> np.ndarray | None:
            before, after = every[steps], every[min(steps + 1, _AFTER[-1])]
            if len(flattened(before)[0]) != len(flattened(after)[0]):
                # What is carried still grows.
                return None
            return self.derivative(before, dt, self.moving(before, free))

        expected = derivative(_BEGINNINGS[-1])
        if expected is None or not all(_is_same(derivative(n), expected) for n in _AFTER):
            return None
        return next(n for n in _BEGINNINGS if _is_same(derivative(n), expected))

    @in_float64
    def start(self, y: np.ndarray, dt: float, steps: int = 0) -> Any:
        """What is carried into the first step from a state, or after some, as NumPy arrays."""
        carried = jax.tree.map(np.array, self._init(y, dt))
        for _ in range(steps):
            carried = self._after(carried, dt)
        return carried

    def first_sample(self, y: np.ndarray, dt: float) -> np.ndarray:
        """The state at the start, as the stepper hands it out before the first step."""
        return self.sample(self.start(y, dt), dt)

    @in_float64
    def sample(self, carried: Any, dt: float) -> np.ndarray:
        """The state that the stepper hands out of what it carries."""
        return np.array(self._state(jax.tree.map(np.array, carried), dt))

    @in_float64
    def step(self, carried: Any, dt: float) -> Any:
        """What is carried after a step, as NumPy arrays."""
        return self._after(carried, dt)

    def _after(self, carried: Any, dt: float) -> Any:
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
        if self.exact:
            return np.asarray(self._derivatives[0](carried, dt))[moving][:, moving]
        flat, unravel = flattened(carried)
        return self.differences(
            lambda near: flattened(self._after(unravel(near), dt))[0], flat, moving
        )

    @in_float64
    def start_derivative(self, y: np.ndarray, dt: float) -> np.ndarray:
        """The derivative of `start`, ``(numbers, components of the state)``."""
        if self.exact:
            return np.asarray(self._derivatives[1](y, dt)).reshape(-1, y.size)
        return self._columns(
            lambda near: flattened(self.start(near.reshape(y.shape), dt))[0], y.ravel()
        )

    @in_float64
    def sample_derivative(self, carried: Any, dt: float) -> np.ndarray:
        """The derivative of `sample`, ``(components of the state, numbers)``."""
        if self.exact:
            return np.asarray(self._derivatives[2](carried, dt))
        flat, unravel = flattened(carried)
        return self._columns(lambda near: self.sample(unravel(near), dt).ravel(), flat)

    def differences(self, function: Callable, flat: np.ndarray, moving: np.ndarray) -> np.ndarray:
        """The derivative of a function of a vector, ``(moving numbers, moving numbers)``.

        Arguments:
            function: in Python, on vectors of one length.
            flat: where.
            moving: which numbers of it to look at.
        """
        return self._columns(function, flat, np.flatnonzero(moving))[moving]

    def _columns(
        self, function: Callable, flat: np.ndarray, chosen: np.ndarray | None = None
    ) -> np.ndarray:
        """Columns of the derivative of a function of a vector; by default all."""
        # Where all is zero, of the size that the problem has elsewhere.
        h = _H * max(float(np.max(np.abs(flat), initial=0.0)), self._scale)

        def after(index: int, distance: float) -> np.ndarray:
            near = np.array(flat)
            near[index] += distance
            return np.asarray(function(near))

        found = [
            sum(w * (after(i, k * h) - after(i, -k * h)) for k, w in _WEIGHTS.items()) / h
            for i in (range(len(flat)) if chosen is None else chosen)
        ]
        return np.stack(found, axis=1)


def _is_same(derivative: np.ndarray | None, expected: np.ndarray) -> bool:
    if derivative is None or derivative.shape != expected.shape:
        return False
    # Where both are not finite, so is what follows.
    apart = np.abs(derivative - expected)
    return not np.any(apart > _SAME * np.max(np.abs(expected)))


def flattened(carried: Any) -> tuple[np.ndarray, Callable]:
    """What is carried as one vector, and the way back: `ravel_pytree` of NumPy arrays, in NumPy."""
    leaves, structure = jax.tree.flatten(carried)
    leaves = [np.asarray(leaf) for leaf in leaves]
    ends = np.cumsum([leaf.size for leaf in leaves])[:-1]

    def unravel(flat: np.ndarray) -> Any:
        pieces = zip(np.split(flat, ends), leaves, strict=True)
        return structure.unflatten(
            [piece.reshape(leaf.shape).astype(leaf.dtype) for piece, leaf in pieces]
        )

    return np.concatenate([leaf.ravel() for leaf in leaves]).astype(np.float64), unravel


class CompiledAhead:
    """A function of a user's stepper, compiled before the user's clock runs.

    Arguments:
        function: of JAX.
    """

    def __init__(self, function: Callable):
        self._jitted = jax.jit(function)
        self._compiled: dict[Hashable, Callable] = {}

    def __call__(self, *given: Any) -> Any:
        """What the function returns, on the user's clock."""
        leaves, structure = jax.tree.flatten(given)
        key = structure, tuple((np.shape(leaf), jnp.result_type(leaf)) for leaf in leaves)
        if key not in self._compiled:
            self._compiled[key] = self._jitted.lower(*given).compile()
        own = self._compiled[key]
        return on_user_clock(jax.block_until_ready, on_user_clock(own, *given))


@functools.lru_cache(maxsize=64)
def _compiled(method: Method, rhs: Rhs, mechanics: Mechanics | None) -> tuple[Callable, ...]:
    """`_functions`, compiled; the same for all methods that compute the same."""
    compiled = jax.jit if isinstance(method.stepper, BuiltIn) else CompiledAhead
    return tuple(map(compiled, _functions(method.stepper, rhs, mechanics)))


def _functions(stepper: Stepper, rhs: Rhs, mechanics: Mechanics | None) -> tuple[Callable, ...]:
    """Start, step and sample, and the derivatives of step, start and sample.

    All are functions ``(args, t, y or what is carried, dt)``.
    """
    init, step, state = on_stored_states(stepper, rhs, mechanics)

    def derivative(of: Callable) -> Callable:
        def slopes(args: Any, t: Any, given: Any, dt: Any) -> Any:
            flat, unravel = ravel_pytree(given)

            def values(flat: Any) -> Any:
                return ravel_pytree(of(args, t, unravel(flat), dt))[0]

            try:
                return jax.jacfwd(values)(flat)
            except TypeError:
                # Loops of diffrax can be differentiated backwards only.
                return jax.jacrev(values)(flat)

        return slopes

    return init, step, state, derivative(step), derivative(init), derivative(state)
