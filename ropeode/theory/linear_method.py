"""What a stepper does to the linear equations on which its stability is judged, as matrices.

A step sees real arrays only. So a complex number ``a + ib`` acts as the real matrix
``[[a, -b], [b, a]]`` on pairs of numbers.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable
from typing import Any, Literal, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree

from ropeode.problems import Problem
from ropeode.problems.links import LinearDamping
from ropeode.simulation import (
    CompiledAhead,
    Method,
    StepMap,
    flattened,
    on_stored_states,
    one_at_a_time,
)
from ropeode.steppers import Stepper
from ropeode.theory.step_samples import StepSamples, in_batches

# Rows that a compiled program takes at once.
_CHUNK = 1024
# Steps of a run that shows what a step does.
_RUN = 3
# Of the largest entry: what is no zero, and by how much powers of a matrix may be others. An
# implicit step solves its equations to a tolerance.
_ZERO, _SAME = 1e-12, 1e-8


def _times(number: Any, y: Any) -> Any:
    """The product with a complex number, a pair; so are those on the last axis of `y`."""
    real, imaginary = number
    return real * y + imaginary * jnp.stack([-y[..., 1], y[..., 0]], axis=-1)


@dataclasses.dataclass(frozen=True, eq=False)
class LinearEquation:
    """A linear equation on which stability is judged, with complex numbers.

    Arguments:
        name: in words.
        make: makes the problem; its frame is 1.
        modes: from modes ``exp(z t)``, ``exp(other t)`` to the problem's `args`, one row of real
            numbers for each pair.
        powers: by which power of dt each of the numbers, and behind them each number of a state,
            has to be multiplied for the same motion.
    """

    name: Literal["y' = lambda y", "x'' = -omega^2 x - 2 gamma x'"]
    make: Callable[[], Problem]
    modes: Callable[[np.ndarray, np.ndarray], np.ndarray]
    powers: tuple[int, ...]

    def __reduce__(self) -> str:
        # It has functions without names, and is found by its own: there are only these two.
        return "FIRST_ORDER" if self is FIRST_ORDER else "OSCILLATOR"

    @functools.cached_property
    def problem(self) -> Problem:
        """With some `args`."""
        return self.make()


FIRST_ORDER = LinearEquation(
    "y' = lambda y",
    lambda: Problem(
        lambda t, y, args: _times(args, y), np.array([1.0, 0.5]), np.arange(2.0), (-1.0, 1.0)
    ),
    lambda z, other: np.stack([np.real(z), np.imag(z)], axis=-1),
    (-1, -1, 0, 0),
)
# Its positions are one node of two components, of mass 1; its `args` are k and the damping rate.
OSCILLATOR = LinearEquation(
    "x'' = -omega^2 x - 2 gamma x'",
    lambda: Problem.second_order(
        lambda t, x, v, args: -_times(args[:2], x) - args[2] * v,
        [[1.0, 0.5]],
        [[0.0, 0.0]],
        [0.0, 1.0],
        (1.0, 0.0, 0.0),
        damping=lambda args: LinearDamping(args[2], args[2]),
    ),
    lambda z, other: np.stack(
        [np.real(z * other), np.imag(z * other), -np.real(z + other)], axis=-1
    ),
    (-2, -2, -1, 0, 0, -1, -1),
)


class _Memory(NamedTuple):
    """A step as a map of what is carried, once the stepper no longer begins.

    Fields:
        start: from states at the start to what is carried into it, ``(cases, carried, state)``.
        step: to what is carried after it, ``(cases, carried, carried)``.
        state: to samples, ``(cases, state, carried)``.
    """

    start: np.ndarray
    step: np.ndarray
    state: np.ndarray


class LinearMethod:
    """A stepper on one of the test equations.

    Arguments:
        equation: `FIRST_ORDER` or `OSCILLATOR`.
        method: that is ready to run.
    """

    def __init__(self, equation: LinearEquation, method: Method):
        self.equation = equation
        self.size = self.problem.y0.size
        self.is_one_step = True
        self._method = dataclasses.replace(method, stepper=method.stepper.on(None))
        self._beginning = 1
        self.is_compiled = method.trial.compiled

    @property
    def problem(self) -> Problem:
        """That of its equation."""
        return self.equation.problem

    def settle(self, args: np.ndarray) -> bool:
        """Find out whether memory counts, from generic cases, ``(cases, numbers)``.

        Returns:
            Whether all steps of a run are one linear map of what is carried, after the first ones.
        """
        every = np.ones(self.problem.y0.shape[-2:], dtype=bool)
        begin = self._map(args[0]).beginning(self.problem.y0, 1.0, every)
        if begin is None:
            return False
        self._beginning = max(1, begin)
        samples = self.powers(args)
        once = samples[:, 1]
        self.is_one_step = self._beginning == 1 and _same(samples[:, 0], np.eye(self.size)[None])
        self.is_one_step &= all(
            _same(samples[:, k + 1], samples[:, k] @ once) for k in range(1, _RUN)
        )
        if self.is_one_step:
            return True
        # Those numbers of what is carried that the state moves, and that move the state.
        memory = self._memory(args)
        links = np.any(_clear(memory.step), axis=0)
        reached = _closure(links, np.any(_clear(memory.start), axis=(0, 2)))
        seen = _closure(links.T, np.any(_clear(memory.state), axis=(0, 1)))
        self._kept = np.flatnonzero(reached & seen)
        return True

    def matrices(self, args: np.ndarray) -> np.ndarray:
        """One step for each case, ``(cases, size, size)``; the step size is 1.

        Of a one-step method complex, and of half the size of a state: what else it carries (an
        acceleration, the last slope) follows from the state. With memory real, and of the size
        of what is carried; where numbers are complex, its eigenvalues are those of a complex
        matrix, and their conjugates.

        Arguments:
            args: ``(cases, numbers)``.
        """
        if not self.is_one_step:
            return self._memory(args).step[:, self._kept][:, :, self._kept]
        units = np.eye(self.size)[::2]
        if self.is_compiled:
            once, _ = _programs(self._method.stepper, self.equation)
            found = in_batches(once, (args,), _CHUNK)
        else:
            found = np.stack([self.runs(row, units, steps=1)[:, 1].T for row in args])
        return found[:, ::2] + 1j * found[:, 1::2]

    def powers(self, args: np.ndarray, steps: int = _RUN) -> np.ndarray:
        """From a state at the start to the samples of a run, ``(cases, samples, size, size)``."""
        runs = [self.runs(row, np.eye(self.size), steps=steps) for row in args]
        return np.moveaxis(np.stack(runs), 1, 3)

    def runs(
        self, row: np.ndarray, y: np.ndarray, t: float = 0.0, dt: float = 1.0, steps: int = _RUN
    ) -> np.ndarray:
        """The samples of short runs of one case, ``(runs, steps + 1, size)``.

        Arguments:
            row: its numbers.
            y: where they start, ``(runs, size)``.
            t, dt: when they start, and their step size.
            steps: of each.
        """
        problem = self.problem.changed(args=tuple(row.tolist()))
        states, times = y.reshape(-1, *problem.y0.shape), np.full(len(y), t)
        samples = StepSamples(problem, self._method)
        found = samples.after(times, states, np.full((len(y), 1), dt), steps)
        return found.reshape(len(y), steps + 1, -1)

    def _memory(self, args: np.ndarray) -> _Memory:
        if self.is_compiled:
            _, memory = _programs(self._method.stepper, self.equation)
            return in_batches(functools.partial(memory, self._beginning), (args,), _CHUNK)
        with one_at_a_time(), np.errstate(all="ignore"):
            rows = [self._memory_in_python(self._map(row)) for row in args]
        return _Memory(*map(np.stack, zip(*rows, strict=True)))

    def _memory_in_python(self, own: StepMap) -> _Memory:
        return _expanded(
            lambda y: own.start(y.reshape(self.problem.y0.shape), 1.0),
            lambda carried: own.step(carried, 1.0),
            lambda carried: own.sample(carried, 1.0).ravel(),
            np.zeros(self.size),
            self._beginning,
        )

    def _map(self, row: np.ndarray) -> StepMap:
        return StepMap(self.problem.changed(args=tuple(row.tolist())), self._method)


@functools.lru_cache(maxsize=64)
def _programs(stepper: Stepper, equation: LinearEquation) -> tuple[Callable, Callable]:
    """The matrices of a step of many cases, and `_expanded` after some steps, for many cases."""
    problem = equation.problem
    init, step, state = on_stored_states(stepper, problem.rhs, problem.mechanics)
    # Traced once, for all steps.
    step = jax.jit(step)

    def on(row: Any) -> tuple[Callable, Callable, Callable]:
        args = tuple(row)
        return (
            lambda y: init(args, 0.0, y.reshape(problem.y0.shape), 1.0),
            lambda carried: step(args, 0.0, carried, 1.0),
            lambda carried: state(args, 0.0, carried, 1.0).ravel(),
        )

    def once(row: Any) -> Any:
        init, step, state = on(row)
        units = jnp.eye(problem.y0.size)[::2]
        return jax.vmap(lambda y: state(step(init(y))))(units).T

    def memory(beginning: Any, row: Any) -> Any:
        return _expanded(*on(row), jnp.zeros(problem.y0.size), beginning)

    return CompiledAhead(jax.vmap(once)), CompiledAhead(jax.vmap(memory, in_axes=(None, 0)))


def _expanded(
    init: Callable, step: Callable, state: Callable, zero: Any, beginning: Any
) -> _Memory:
    """By values alone: what is affine shows its matrices so, to rounding.

    Arguments:
        init: from a state to what is carried.
        step: from what is carried to what is carried after a step.
        state: from what is carried to the state.
        zero: the state zero.
        beginning: how many steps come before the one that is looked at.
    """
    in_numpy = isinstance(zero, np.ndarray)

    def begun(y: Any) -> Any:
        if not in_numpy:
            return jax.lax.fori_loop(0, beginning, lambda _, carried: step(carried), init(y))
        return functools.reduce(lambda carried, _: step(carried), range(beginning), init(y))

    ravel: Callable = flattened if in_numpy else ravel_pytree

    def numbers(carried: Any) -> Any:
        return ravel(carried)[0]

    def columns(function: Callable, at: Any) -> Any:
        origin = function(at)
        if in_numpy:
            return np.stack([function(at + unit) - origin for unit in np.eye(len(at))], axis=1)
        return jax.vmap(lambda unit: function(at + unit) - origin)(jnp.eye(len(at))).T

    still = begun(zero)
    flat, unravel = ravel(still)
    # Not what counts or decides, which no step multiplies.
    own = np.concatenate(
        [
            np.full(np.size(leaf), np.issubdtype(np.result_type(leaf), np.floating))
            for leaf in jax.tree.leaves(still)
        ]
    )
    return _Memory(
        columns(lambda y: numbers(begun(y)), zero)[own],
        columns(lambda near: numbers(step(unravel(near))), flat)[own][:, own],
        columns(lambda near: state(unravel(near)), flat)[:, own],
    )


def _clear(matrices: np.ndarray) -> np.ndarray:
    """Which entries are no zeros."""
    sizes = np.abs(np.nan_to_num(matrices))
    return sizes > _ZERO * np.max(sizes, initial=0.0)


def _closure(links: np.ndarray, start: np.ndarray) -> np.ndarray:
    """What can be reached along ``links[to, from]``."""
    reached = start
    for _ in range(len(links)):
        reached = reached | np.any(links[:, reached], axis=1)
    return reached


def _same(a: np.ndarray, b: np.ndarray) -> bool:
    return bool(np.max(np.abs(a - b)) <= _SAME * np.max(np.abs(b)))
