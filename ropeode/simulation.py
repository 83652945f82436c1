"""The driver: a problem, a stepper and a step size make a trajectory."""

from __future__ import annotations

import dataclasses
import functools
import time
from collections.abc import Callable
from typing import Any, Literal, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ropeode.errors import InputError
from ropeode.precision import in_float64
from ropeode.problems.problem import Mechanics, Problem
from ropeode.steppers import stepper as stepper_named
from ropeode.steppers.base import Stepper, System
from ropeode.steppers.phase import Phase
from ropeode.validation import check_whole


@dataclasses.dataclass(frozen=True, eq=False)
class Trajectory:
    """What a stepper made of a problem.

    Arguments:
        problem: what was solved.
        stepper: with what.
        steps_per_frame: steps between two sample times; ``dt = frame/steps_per_frame``.
        times: the sample times up to the last one with a finite state, ``(times,)``.
        states: the states there, ``(times, *state)``; the first is the initial state.
        status: `ok`, or `diverged` if a state was not finite.
        diverged_at: the frame (index of the sample time) of the first state that was not.
        rhs_evaluations: of the right-hand side (or acceleration), for the steps made.
        seconds: to run, without compiling.
        compile_seconds: to trace and compile; 0 if that had been done before.
    """

    problem: Problem
    stepper: Stepper
    steps_per_frame: int
    times: np.ndarray
    states: np.ndarray
    status: Literal["ok", "diverged"]
    diverged_at: int | None
    rhs_evaluations: int
    seconds: float
    compile_seconds: float

    @property
    def dt(self) -> float:
        """The step size; the largest where frames differ in length."""
        return step_size(self.problem, self.steps_per_frame)

    @property
    def positions(self) -> np.ndarray:
        """Positions, ``(times, nodes, dim)``."""
        return self.problem.positions(self.states)

    @property
    def velocities(self) -> np.ndarray:
        """Velocities, ``(times, nodes, dim)``."""
        return self.problem.velocities(self.states)


@in_float64
def simulate(problem: Problem, stepper: str | Stepper, steps_per_frame: int) -> Trajectory:
    """Run a stepper over all frames of a problem.

    A run that leaves the finite numbers is not computed past the frame where it does.

    Arguments:
        problem: what to solve.
        stepper: a stepper or its name with options.
        steps_per_frame: equal steps in each interval between sample times.

    Raises:
        InputError: the stepper does not exist or cannot run on this problem, or
            `steps_per_frame` is not a whole number >= 1.
    """
    stepper = stepper_named(stepper)
    steps = check_whole("steps_per_frame", steps_per_frame, at_least=1, example="64")
    if refusal := stepper.refusal(problem):
        raise InputError(refusal)

    mechanics = problem.mechanics
    program = _program(
        stepper,
        problem.rhs,
        mechanics,
        *_abstract(problem.y0, problem.args, problem.frames),
    )
    started = time.perf_counter()
    frame, states = program.run(
        problem.y0, problem.args, problem.ts, _frame_lengths(problem), steps
    )
    frame, states = int(frame), np.asarray(states)
    seconds = time.perf_counter() - started

    finite = bool(np.all(np.isfinite(states[frame])))
    kept = frame + finite
    return Trajectory(
        problem=problem,
        stepper=stepper,
        steps_per_frame=steps,
        times=problem.ts[:kept],
        states=states[:kept],
        status="ok" if finite else "diverged",
        diverged_at=None if finite else frame,
        rhs_evaluations=program.calls(steps, frame),
        seconds=seconds,
        compile_seconds=program.take_compile_seconds(),
    )


def step_size(problem: Problem, steps_per_frame: int) -> float:
    """The (largest) step size of a number of steps per frame."""
    return float(np.max(_frame_lengths(problem))) / steps_per_frame


def _frame_lengths(problem: Problem) -> np.ndarray:
    """The length of each frame; all the same number where they are equal but for rounding."""
    if problem.equal_frames:
        return np.full(problem.frames, (problem.ts[-1] - problem.ts[0]) / problem.frames)
    return np.diff(problem.ts)


class Abstract(NamedTuple):
    """Shape and dtype of an array; hashable."""

    shape: tuple[int, ...]
    dtype: Any


def _abstract(y0: np.ndarray, args: Any, frames: int) -> tuple[Abstract, Any, tuple, int]:
    leaves, tree = jax.tree.flatten(args)
    return (
        Abstract(y0.shape, y0.dtype),
        tree,
        tuple(Abstract(leaf.shape, leaf.dtype) for leaf in leaves),
        frames,
    )


class _Program:
    """A compiled driver loop for one stepper, right-hand side and set of shapes."""

    def __init__(self, run: Callable, calls: tuple[int, int, int], compile_seconds: float):
        self.run = run
        self._to_start, self._per_step, self._per_sample = calls
        self._compile_seconds = compile_seconds

    def calls(self, steps: int, frames: int) -> int:
        """How often a run of so many frames evaluates the right-hand side."""
        return self._to_start + (self._per_step * steps + self._per_sample) * frames

    def take_compile_seconds(self) -> float:
        """The seconds that compiling took; 0 for every later use of the program."""
        seconds, self._compile_seconds = self._compile_seconds, 0.0
        return seconds


@functools.lru_cache(maxsize=256)
def _program(
    stepper: Stepper,
    rhs: Callable,
    mechanics: Mechanics | None,
    y0: Abstract,
    args_tree: Any,
    args_leaves: tuple[Abstract, ...],
    frames: int,
) -> _Program:
    """Compile the loop; the number of steps is a run-time value of it."""
    started = time.perf_counter()
    calls = [0]

    def counted(function: Callable) -> Callable:
        def call(t: Any, state: Any, *velocity: Any) -> Any:
            calls[0] += 1
            # What the first stage of a step reads is stored anyway, as the step's input.
            return function(t, _stored(state) if calls[0] > 1 else state, *velocity)

        return call

    def system_of(args: Any) -> System:
        if mechanics is None:
            return System(counted(lambda t, y: rhs(t, y, args)))
        every_force = mechanics.acceleration
        acceleration = counted(lambda t, x, v: every_force(t, x, v, args))
        return System(
            lambda t, y: Phase(y.v, acceleration(t, y.x, y.v)),
            acceleration,
            mechanics.damping(args) if mechanics.damping else None,
        )

    def run(y0: Any, args: Any, ts: Any, lengths: Any, steps: Any) -> Any:
        system = system_of(args)

        def one_frame(loop: tuple) -> tuple:
            frame, carried, states, _ = loop
            dt = lengths[frame] / steps

            def one_step(i: Any, carried: Any) -> Any:
                calls[0] = 0
                return stepper.step(system, ts[frame] + i * dt, carried, dt)

            carried = jax.lax.fori_loop(0, steps, one_step, carried)
            y = stepper.state(system, ts[frame + 1], carried, dt)
            y = jnp.stack(y) if isinstance(y, Phase) else y
            states = jax.lax.dynamic_update_index_in_dim(states, y, frame + 1, 0)
            return frame + 1, carried, states, jnp.all(jnp.isfinite(y))

        def more(loop: tuple) -> Any:
            frame, _, _, finite = loop
            return (frame < frames) & finite

        start = Phase(y0[0], y0[1]) if mechanics else y0
        carried = stepper.init(system, ts[0], start, lengths[0] / steps)
        states = jnp.zeros((frames + 1, *y0.shape), y0.dtype).at[0].set(y0)
        frame, _, states, _ = jax.lax.while_loop(
            more, one_frame, (0, carried, states, jnp.asarray(True))
        )
        return frame, states

    def shape(abstract: Abstract) -> jax.ShapeDtypeStruct:
        return jax.ShapeDtypeStruct(abstract.shape, abstract.dtype)

    number = jax.ShapeDtypeStruct((), np.float64)
    args = jax.tree.unflatten(args_tree, [shape(leaf) for leaf in args_leaves])

    def calls_of(method: Callable, *inputs: Any) -> tuple[int, Any]:
        calls[0] = 0
        result = jax.eval_shape(
            lambda args, t, y, dt: method(system_of(args), t, y, dt), args, number, *inputs, number
        )
        return calls[0], result

    start = shape(y0)
    if mechanics:
        half = jax.ShapeDtypeStruct(y0.shape[1:], y0.dtype)
        start = Phase(half, half)
    to_start, carried = calls_of(stepper.init, start)
    per_step, _ = calls_of(stepper.step, carried)
    per_sample, _ = calls_of(stepper.state, carried)

    compiled = (
        jax.jit(run)
        .lower(
            shape(y0),
            args,
            jax.ShapeDtypeStruct((frames + 1,), np.float64),
            jax.ShapeDtypeStruct((frames,), np.float64),
            jax.ShapeDtypeStruct((), np.int64),
        )
        .compile()
    )

    def call(*inputs: Any) -> Any:
        *rest, steps = inputs
        return jax.block_until_ready(compiled(*rest, np.int64(steps)))

    return _Program(call, (to_start, per_step, per_sample), time.perf_counter() - started)


def _stored(state: Any) -> Any:
    """The state (or the positions) of a stage, computed once.

    XLA would fuse what computes it into each place of the right-hand side that reads it, and
    the stage before into that, and so on. JAX 0.10 drops the barrier before it fuses; but it
    never fuses a sum over a leading axis with what reads the sum.
    """
    if jax.__version_info__ >= (0, 12):
        return jax.lax.optimization_barrier(state)
    return jnp.sum(jnp.stack([state, jnp.zeros_like(state)]), axis=0)
