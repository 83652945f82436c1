"""The driver: a problem, a stepper and a step size make a trajectory."""

from __future__ import annotations

import dataclasses
import functools
import time
from collections.abc import Callable, Sequence
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
from ropeode.validation import check_whole, complaint


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


# Frames that ropes side by side are taken through before they are looked at.
_FRAMES_AT_ONCE = 100


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

    program = _program(
        stepper,
        problem.rhs,
        problem.mechanics,
        *_abstract(problem.y0, problem.args),
        problem.frames,
        1,
    )
    started = time.perf_counter()
    segment = program.run(
        problem.y0, problem.args, problem.ts, _frame_lengths(problem), steps, None
    )
    seconds = time.perf_counter() - started
    return _trajectory(problem, stepper, steps, program, segment.states, segment.frames, seconds)


@in_float64
def simulate_side_by_side(
    problems: Sequence[Problem],
    stepper: str | Stepper,
    steps_per_frame: int,
    *,
    progress: Callable[[float], None] = lambda fraction: None,
) -> list[Trajectory]:
    """Run a stepper on several ropes at once, which differ in their numbers only.

    Their nodes are stored in turn, as `Links` explains, so that the processor's vector units
    have long rows to work on: that is several times as fast as one rope after the other. A
    rope whose state is no longer finite does not hold up the others.

    Arguments:
        problems: ropes of one kind, with as many nodes and the same sample times.
        stepper: a stepper or its name with options.
        steps_per_frame: equal steps in each interval between sample times.
        progress: called with the fraction that is done.

    Returns:
        A trajectory for each problem. Its seconds are an equal share of the whole.

    Raises:
        InputError: as for `simulate`; or the problems are not of one family.
    """
    stepper = stepper_named(stepper)
    steps = check_whole("steps_per_frame", steps_per_frame, at_least=1, example="64")
    _check_family(problems)
    if refusals := [refusal for each in problems if (refusal := stepper.refusal(each))]:
        raise InputError(refusals[:1])
    first = problems[0]
    ropes, nodes = len(problems), first.y0.shape[-1]

    def in_turn(*rows: np.ndarray) -> np.ndarray:
        """Rows of nodes or links in turn; a vector that is the same for all nodes, for each."""
        same = rows[0].ndim > 1 and rows[0].shape[-1] == 1
        each = [np.repeat(row, nodes, axis=-1) for row in rows] if same else rows
        return np.stack(each, axis=-1).reshape(*each[0].shape[:-1], -1)

    y0 = in_turn(*(each.y0 for each in problems))
    args = jax.tree.map(in_turn, *(each.args for each in problems))

    def program_for(frames: int) -> _Program:
        family = (stepper, first.rhs, first.mechanics, *_abstract(y0, args))
        return _program(*family, frames, ropes)

    program = program_for(min(_FRAMES_AT_ONCE, first.frames))
    lengths, done, carried = _frame_lengths(first), 0, None
    parts = [y0[None]]
    started = time.perf_counter()
    while done < first.frames:
        frames = min(_FRAMES_AT_ONCE, first.frames - done)
        ts, inside = first.ts[done : done + frames + 1], lengths[done : done + frames]
        segment = program_for(frames).run(y0, args, ts, inside, steps, carried)
        parts.append(segment.states[1 : segment.frames + 1])
        carried, done = segment.carried, done + segment.frames
        progress(done / first.frames)
        if segment.frames < frames:
            break
    seconds = (time.perf_counter() - started) / len(problems)
    states = np.concatenate(parts)
    found = []
    for rope, problem in enumerate(problems):
        own = np.ascontiguousarray(states[..., rope::ropes])
        frame = _last_looked_at(own)
        found.append(_trajectory(problem, stepper, steps, program, own, frame, seconds))
    return found


def _check_family(problems: Sequence[Problem]) -> None:
    """Raises:
    InputError: there is no problem, or they do not differ in their numbers only.
    """
    if not problems:
        raise InputError(complaint("problems", problems, "at least one problem", "give one"))
    first = problems[0]
    for each in problems:
        if (
            each.mechanics is None
            or each.mechanics.links is None
            or each.rhs != first.rhs
            or each.mechanics != first.mechanics
            or _abstract(each.y0, each.args) != _abstract(first.y0, first.args)
            or not np.array_equal(each.ts, first.ts)
        ):
            raise InputError(
                complaint(
                    "problems",
                    [first.name, each.name],
                    "ropes of one kind, with as many nodes and the same sample times",
                    "run them one by one with simulate",
                )
            )


def _last_looked_at(states: np.ndarray) -> int:
    """The index of the first state that is not finite, or else of the last."""
    finite = np.all(np.isfinite(states.reshape(len(states), -1)), axis=1)
    return len(states) - 1 if np.all(finite) else int(np.argmin(finite))


def _trajectory(
    problem: Problem,
    stepper: Stepper,
    steps: int,
    program: _Program,
    states: np.ndarray,
    frame: int,
    seconds: float,
) -> Trajectory:
    """What a run came to whose last state that counts is that of `frame`."""
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


def _abstract(y0: np.ndarray, args: Any) -> tuple[Abstract, Any, tuple]:
    leaves, tree = jax.tree.flatten(args)
    return (
        Abstract(y0.shape, y0.dtype),
        tree,
        tuple(Abstract(leaf.shape, leaf.dtype) for leaf in leaves),
    )


class _Segment(NamedTuple):
    """Frames that were run in one go.

    Fields:
        frames: how many; fewer than asked for where no finite state was left.
        states: the first is that at the start, ``(frames + 1, *state)``.
        carried: what the next segment goes on from.
    """

    frames: int
    states: np.ndarray
    carried: Any


class _Program:
    """A compiled driver loop for one stepper, right-hand side and set of shapes.

    Arguments:
        compiled: the loop.
        nothing_carried: stands for what is carried where there is nothing yet.
        calls: of the right-hand side, to start, in a step, and for a sample.
        compile_seconds: that compiling took.
    """

    def __init__(
        self,
        compiled: Callable,
        nothing_carried: Any,
        calls: tuple[int, int, int],
        compile_seconds: float,
    ):
        self._compiled = compiled
        self._nothing_carried = nothing_carried
        self._to_start, self._per_step, self._per_sample = calls
        self._compile_seconds = compile_seconds

    def run(
        self, y0: np.ndarray, args: Any, ts: np.ndarray, lengths: Any, steps: int, carried: Any
    ) -> _Segment:
        """Run the frames between sample times; from the start where nothing is carried."""
        frame, states, carried = jax.block_until_ready(
            self._compiled(
                y0,
                args,
                ts,
                lengths,
                np.int64(steps),
                np.bool_(carried is None),
                self._nothing_carried if carried is None else carried,
            )
        )
        return _Segment(int(frame), np.asarray(states), carried)

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
    ropes: int,
) -> _Program:
    """Compile the loop over `frames`; the number of steps is a run-time value of it.

    Of several `ropes` side by side, the loop goes on as long as one is finite.
    """
    started = time.perf_counter()
    calls = [0]

    def counted(function: Callable) -> Callable:
        def call(t: Any, state: Any, *velocity: Any) -> Any:
            calls[0] += 1
            # What the first stage of a step reads is stored anyway, as the step's input.
            return function(t, _stored(state) if calls[0] > 1 else state, *velocity)

        return call

    def system_of(args: Any) -> System:
        return system(rhs, mechanics, args, counted)

    def going_on(y: Any) -> Any:
        """Whether the state (or that of a rope side by side) is still finite."""
        finite = jnp.isfinite(y)
        if ropes == 1:
            return jnp.all(finite)
        return jnp.any(jnp.all(finite.reshape(-1, ropes), axis=0))

    def run(y0: Any, args: Any, ts: Any, lengths: Any, steps: Any, fresh: Any, carried: Any) -> Any:
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
            return frame + 1, carried, states, going_on(y)

        def more(loop: tuple) -> Any:
            frame, _, _, finite = loop
            return (frame < frames) & finite

        start = Phase(y0[0], y0[1]) if mechanics else y0
        begun = stepper.init(system, ts[0], start, lengths[0] / steps)
        carried = jax.tree.map(lambda new, old: jnp.where(fresh, new, old), begun, carried)
        states = jnp.zeros((frames + 1, *y0.shape), y0.dtype).at[0].set(y0)
        frame, carried, states, _ = jax.lax.while_loop(
            more, one_frame, (0, carried, states, jnp.asarray(True))
        )
        return frame, states, carried

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
            jax.ShapeDtypeStruct((), np.bool_),
            carried,
        )
        .compile()
    )
    nothing = jax.tree.map(lambda leaf: np.zeros(leaf.shape, leaf.dtype), carried)
    return _Program(
        compiled, nothing, (to_start, per_step, per_sample), time.perf_counter() - started
    )


def system(
    rhs: Callable,
    mechanics: Mechanics | None,
    args: Any,
    counted: Callable[[Callable], Callable] = lambda function: function,
) -> System:
    """A problem with its numbers bound, as a stepper sees it.

    Arguments:
        rhs: of the problem.
        mechanics: of the problem.
        args: of the problem.
        counted: wraps each function whose calls are to be counted.
    """
    if mechanics is None:
        return System(counted(lambda t, y: rhs(t, y, args)))
    damping, links, every_force = mechanics.damping, mechanics.links, mechanics.acceleration
    acceleration = counted(lambda t, x, v: every_force(t, x, v, args))
    return System(
        lambda t, y: Phase(y.v, acceleration(t, y.x, y.v)),
        acceleration,
        damping(args) if damping else None,
        links(args) if links else None,
    )


def _stored(state: Any) -> Any:
    """The state (or the positions) of a stage, computed once.

    XLA would fuse what computes it into each place of the right-hand side that reads it, and
    the stage before into that, and so on. JAX 0.10 drops the barrier before it fuses; but it
    never fuses a sum over a leading axis with what reads the sum.
    """
    if jax.__version_info__ >= (0, 12):
        return jax.lax.optimization_barrier(state)
    return jnp.sum(jnp.stack([state, jnp.zeros_like(state)]), axis=0)
