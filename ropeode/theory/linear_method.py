"""What a stepper does to a linear test equation, as matrices."""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ropeode.problems import Problem
from ropeode.simulation import Method, PythonStepper, on_stored_states, on_user_clock, one_at_a_time
from ropeode.steppers import BuiltIn, Stepper
from ropeode.theory.linear_equations import Spring

# Rows that a compiled program takes at once, and springs side by side in NumPy.
_CHUNK, _TOGETHER = 1024, 256
# Steps of a run that shows what a step does; and of one that shows whether a user's step, which may
# begin as another method than it goes on as, does the same at each step; and how many of these it
# may take to begin. Its matrix must give all samples that follow.
_RUN, _LONG_RUN, BEGINNINGS = 3, 32, (1, 2, 4, 8, 16)
# Of the largest entry: what is no zero, and by how much powers of a matrix may be others. An
# implicit step solves its equations to a tolerance.
_ZERO, _SAME = 1e-12, 1e-8


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
        equation: from `ropeode.theory.linear_equations`.
        method: that is ready to run.
    """

    def __init__(self, equation: Problem, method: Method):
        self.kind = type(equation.args)
        self.size = equation.y0.size
        self.is_one_step, self.is_together = True, False
        self._shape = equation.y0.shape
        self._stepper = method.stepper.on(None)
        self.equation = equation
        own = type(method.stepper)
        self._may_begin = own.init is not Stepper.init and not issubclass(own, BuiltIn)
        self._beginning = BEGINNINGS[0]
        self.is_compiled = method.trial.compiled

    def settle(self, args: np.ndarray) -> bool:
        """Find out whether memory counts, from generic cases, ``(cases, numbers)``.

        And for springs in Python, whether many of them can be one state.

        Returns:
            Whether all steps of a run are one linear map of what is carried, after the first ones.
        """
        samples = self.powers(args)
        if not self.is_compiled and self.kind is Spring:
            self.is_together = True
            with contextlib.suppress(Exception):
                self.is_together = _same(self.powers(args), samples)
        if self._may_begin:
            samples = self.powers(args, _LONG_RUN)
        once = samples[:, 1]
        self.is_one_step = _same(samples[:, 0], np.broadcast_to(np.eye(self.size), once.shape))
        self.is_one_step &= all(
            _same(samples[:, k + 1], samples[:, k] @ once) for k in range(1, samples.shape[1] - 1)
        )
        if self.is_one_step:
            return True
        if self._may_begin and not self._goes_on(args, samples):
            return False
        # Those numbers of what is carried that the state moves, and that move the state. Where
        # the two components go their own ways, what belongs to the first will do.
        real = args.copy()
        real[:, 1] = 0.0
        self._kept = self._that_counts(args, slice(None))
        self._kept_if_real = self._that_counts(real, slice(None, None, 2))
        return True

    def _goes_on(self, args: np.ndarray, samples: np.ndarray) -> bool:
        """Find after how many steps the matrix of one gives all samples that follow."""
        for self._beginning in BEGINNINGS:
            start, step, state = self._memory(args)
            if step.shape[1] != step.shape[2]:
                # What is carried still grows.
                continue
            for sample in np.moveaxis(samples[:, self._beginning :], 1, 0):
                if not _same(state @ start, sample):
                    break
                start = step @ start
            else:
                return True
        return False

    def _that_counts(self, args: np.ndarray, numbers: slice) -> np.ndarray:
        """The indices of what is carried that some numbers of the state move and are moved by."""
        memory = self._memory(args)
        links = np.any(_clear(memory.step), axis=0)
        reached = _closure(links, np.any(_clear(memory.start)[:, :, numbers], axis=(0, 2)))
        seen = _closure(links.T, np.any(_clear(memory.state)[:, numbers], axis=(0, 1)))
        return np.flatnonzero(reached & seen)

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
            kept = self._kept if np.any(args[:, 1]) else self._kept_if_real
            return self._memory(args).step[:, kept][:, :, kept]
        columns = [
            self.runs(args, np.broadcast_to(unit, (len(args), self.size)), steps=1)[:, 1]
            for unit in np.eye(self.size)[::2]
        ]
        found = np.stack(columns, axis=2)
        return found[:, ::2] + 1j * found[:, 1::2]

    def powers(self, args: np.ndarray, steps: int = _RUN) -> np.ndarray:
        """From a state at the start to the samples of a run, ``(cases, samples, size, size)``."""
        units = np.broadcast_to(np.eye(self.size)[:, None], (self.size, len(args), self.size))
        return np.stack([self.runs(args, unit, steps=steps) for unit in units], axis=3)

    def runs(
        self,
        args: np.ndarray,
        y: np.ndarray,
        t: float = 0.0,
        dt: float = 1.0,
        steps: int = _RUN,
    ) -> np.ndarray:
        """The samples of short runs, ``(cases, steps + 1, size)``.

        Arguments:
            args: ``(cases, numbers)``.
            y: where they start, ``(cases, size)``.
            t, dt: when they start, and their step size.
            steps: 32 at most.
        """
        if self.is_compiled:
            return self._chunks(self._compiled_run, args, t, dt, steps, y)[:, : steps + 1]
        if self.is_together and len(args) > 1:
            return self._together(args, y, t, dt, steps)
        with one_at_a_time(), np.errstate(all="ignore"):
            return np.stack(
                [
                    on_user_clock(_run, *self._in_python(row, t, dt), start, steps)
                    for row, start in zip(args, y, strict=True)
                ]
            )

    def _together(
        self, args: np.ndarray, y: np.ndarray, t: float, dt: float, steps: int
    ) -> np.ndarray:
        """Runs of springs side by side, each a node, in NumPy at once."""
        count = -len(args) % _TOGETHER
        rows, starts = (np.pad(each, [(0, count), (0, 0)], mode="edge") for each in (args, y))
        shape = 2, len(rows), 2
        own = PythonStepper(
            self.equation.changed(
                y0=np.zeros(shape), args=self.kind(*(each[:, None] for each in rows.T))
            ),
            self._stepper,
        )
        functions = (
            lambda y: own.init(t, y, dt),
            lambda i, carried: own.step(t + i * dt, _copied(carried), dt),
            lambda i, carried: own.state(t + i * dt, _copied(carried), dt),
        )
        start = np.moveaxis(starts.reshape(-1, 2, 2), 0, 1)
        with one_at_a_time(), np.errstate(all="ignore"):
            found = on_user_clock(_run, *functions, start, steps)
        return np.moveaxis(found, 2, 0)[: len(args)].reshape(len(args), steps + 1, self.size)

    def _memory(self, args: np.ndarray) -> _Memory:
        if self.is_compiled:
            return _Memory(*self._chunks(self._compiled_memory, args, 0.0, 1.0, self._beginning))
        zero, steps = np.zeros(self.size), self._beginning
        with one_at_a_time(), np.errstate(all="ignore"):
            rows = [
                on_user_clock(_expanded, *self._in_python(row, 0.0, 1.0), zero, steps)
                for row in args
            ]
        return _Memory(*map(np.stack, zip(*rows, strict=True)))

    def _in_python(self, row: np.ndarray, t: float, dt: float) -> tuple[Callable, ...]:
        """`init`, `step` and `state` on flat states."""
        problem = self.equation.changed(args=self.kind(*row.tolist()))
        own = PythonStepper(problem, self._stepper)
        return (
            lambda y: own.init(t, y.reshape(self._shape), dt),
            lambda i, carried: own.step(t + i * dt, _copied(carried), dt),
            lambda i, carried: own.state(t + i * dt, _copied(carried), dt).reshape(-1),
        )

    def _chunks(
        self,
        program: Callable,
        args: np.ndarray,
        t: float,
        dt: float,
        steps: int,
        y: np.ndarray | None = None,
    ) -> Any:
        """What a compiled program makes of all rows, in pieces that are equally long."""
        given = [args] if y is None else [args, y]
        pieces = []
        for first in range(0, len(args), _CHUNK):
            rows = [each[first : first + _CHUNK] for each in given]
            count = len(rows[0])
            padded = [np.pad(each, [(0, _CHUNK - count), (0, 0)], mode="edge") for each in rows]
            result = on_user_clock(program, t, dt, steps, *padded)
            found = on_user_clock(jax.block_until_ready, result)
            pieces.append(jax.tree.map(lambda each, count=count: np.asarray(each)[:count], found))
        return jax.tree.map(lambda *each: np.concatenate(each), *pieces)

    def __getstate__(self) -> dict[str, Any]:
        # Of a pickle or a copy: programs belong to their process.
        compiled = ("_compiled_run", "_compiled_memory")
        return {name: value for name, value in vars(self).items() if name not in compiled}

    @functools.cached_property
    def _compiled_run(self) -> Callable:
        def run(t: Any, dt: Any, steps: Any, row: Any, y: Any) -> Any:
            init, step, state = self._in_jax(row, t, dt)

            def advance(i: Any, progress: tuple[Any, Any]) -> tuple[Any, Any]:
                carried = step(i, progress[0])
                return carried, progress[1].at[i + 1].set(state(i + 1, carried))

            carried = init(y)
            samples = jnp.zeros((_LONG_RUN + 1, self.size)).at[0].set(state(0, carried))
            return jax.lax.fori_loop(0, steps, advance, (carried, samples))[1]

        return self._compile(run, (_CHUNK, len(self.kind._fields)), (_CHUNK, self.size))

    @functools.cached_property
    def _compiled_memory(self) -> Callable:
        def memory(t: Any, dt: Any, steps: Any, row: Any) -> Any:
            init, step, state = self._in_jax(row, t, dt)
            return _expanded(init, step, state, jnp.zeros(self.size), steps)

        return self._compile(memory, (_CHUNK, len(self.kind._fields)))

    def _compile(self, function: Callable, *rows: tuple[int, ...]) -> Callable:
        """Before the user's clock runs."""
        number = jax.ShapeDtypeStruct((), np.float64)
        given = [jax.ShapeDtypeStruct(shape, np.float64) for shape in rows]
        steps = jax.ShapeDtypeStruct((), np.int64)
        batch = jax.vmap(function, in_axes=(None, None, None, *(0 for _ in rows)))
        return jax.jit(batch).lower(number, number, steps, *given).compile()

    def _in_jax(self, row: Any, t: Any, dt: Any) -> tuple[Callable, ...]:
        equation, args = self.equation, self.kind(*row)
        init, step, state = on_stored_states(self._stepper, equation.rhs, equation.mechanics)
        # Traced once, for all steps.
        once = jax.jit(step)
        return (
            lambda y: init(args, t, y.reshape(self._shape), dt),
            lambda i, carried: once(args, t + i * dt, carried, dt),
            lambda i, carried: state(args, t + i * dt, carried, dt).reshape(-1),
        )


def _run(init: Callable, step: Callable, state: Callable, y: np.ndarray, steps: int) -> np.ndarray:
    """The samples of a run, ``(steps + 1, size)``."""
    carried = init(y)
    samples = [state(0, carried)]
    for i in range(steps):
        carried = step(i, carried)
        samples.append(state(i + 1, carried))
    return np.stack(samples)


def _expanded(
    init: Callable, step: Callable, state: Callable, zero: Any, beginning: Any
) -> _Memory:
    """By values alone: what is affine shows its matrices so, to rounding.

    Arguments:
        init: from a state to what is carried.
        step: ``step(i, carried)``, from the time of step i.
        state: ``state(i, carried)``, at the time of step i.
        zero: the state zero.
        beginning: how many steps come before the one that is looked at.
    """
    in_numpy = isinstance(zero, np.ndarray)

    def begun(y: Any) -> Any:
        if not in_numpy:
            return jax.lax.fori_loop(0, beginning, step, init(y))
        carried = init(y)
        for i in range(beginning):
            carried = step(i, carried)
        return carried

    still = begun(zero)
    origin = _numbers(still)
    after, shown = _numbers(step(beginning, still)), state(beginning, still)

    def near(direction: Any) -> Any:
        return _with_numbers(still, origin + direction)

    def columns(function: Callable, size: int) -> Any:
        if in_numpy:
            return np.stack([function(unit) for unit in np.eye(size)], axis=1)
        return jax.vmap(function)(jnp.eye(size)).T

    return _Memory(
        columns(lambda e: _numbers(begun(e)) - origin, len(zero)),
        columns(lambda e: _numbers(step(beginning, near(e))) - after, len(origin)),
        columns(lambda e: state(beginning, near(e)) - shown, len(origin)),
    )


def _is_number(leaf: Any) -> bool:
    """Whether it is none of what counts or decides, which stays as it is."""
    return np.issubdtype(np.result_type(leaf), np.floating)


def _numbers(carried: Any) -> Any:
    """The floating-point numbers of what is carried, as one vector."""
    leaves = [leaf for leaf in jax.tree.leaves(carried) if _is_number(leaf)]
    own = jnp if any(isinstance(leaf, jax.Array) for leaf in leaves) else np
    return own.concatenate([own.ravel(leaf) for leaf in leaves])


def _with_numbers(like: Any, numbers: Any) -> Any:
    """The opposite of `_numbers`; what is no number is as in `like`."""
    leaves, structure = jax.tree.flatten(like)
    first = 0
    for i, leaf in enumerate(leaves):
        if _is_number(leaf):
            size = np.size(leaf)
            leaves[i] = numbers[first : first + size].reshape(np.shape(leaf))
            first += size
    return jax.tree.unflatten(structure, leaves)


def _copied(carried: Any) -> Any:
    """A step may write to what it is handed."""
    return jax.tree.map(lambda leaf: leaf.copy() if isinstance(leaf, np.ndarray) else leaf, carried)


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
