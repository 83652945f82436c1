"""The compiled driver: blocks of runs, each a loop over frames around a loop over steps."""

from __future__ import annotations

import dataclasses
import functools
import threading
import time
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.extend.core import get_opaque_trace_state

from ropeode.problems.problem import Mechanics
from ropeode.simulation.kernel_fusion import in_one_kernel
from ropeode.simulation.layout import Layout
from ropeode.simulation.method import Method
from ropeode.simulation.system import is_turned, stored, system
from ropeode.simulation.transposes import on_stored
from ropeode.simulation.user_clock import on_user_clock
from ropeode.steppers.phase import Phase


class Family(NamedTuple):
    """What runs have in common that one program can make; hashable.

    Fields:
        method: the stepper, ready to run.
        rhs, mechanics: of the problem.
        layout: of the runs in a block.
        y0: the initial state of a block.
        args_tree, args_leaves: the problem's arguments, for a block.
    """

    method: Method
    rhs: Callable
    mechanics: Mechanics | None
    layout: Layout
    y0: jax.ShapeDtypeStruct
    args_tree: Any
    args_leaves: tuple[jax.ShapeDtypeStruct, ...]


@dataclasses.dataclass(eq=False)
class Program:
    """A compiled loop for one family of runs.

    Arguments:
        compiled: the loop.
        capacity: the most frames that it runs in one go.
        nothing_carried: stands for what is carried where there is nothing yet.
        evaluations: of the right-hand side, to start, in a step, and for a sample; None where they
            are made in a loop, whose length nobody knows.
        compile_seconds: that compiling took; 0 once they were taken.
    """

    compiled: Callable
    capacity: int
    nothing_carried: Any
    evaluations: tuple[int, int, int] | None
    compile_seconds: float

    def run(
        self,
        y0: np.ndarray,
        args: Any,
        ts: np.ndarray,
        lengths: np.ndarray,
        steps: int,
        carried: Any = None,
        count: int = 1,
    ) -> tuple[np.ndarray, np.ndarray, Any]:
        """Run the frames between sample times, in one go.

        Arguments:
            y0: initial states, ``(blocks, *state)``.
            args: of the problem; each leaf has the blocks first.
            ts: sample times, at most one more than the capacity.
            lengths: of the frames.
            steps: in each frame.
            carried: what an earlier call returned; None at the start.
            count: how many of the blocks are run.

        Returns:
            How many frames were run of each block: fewer where no run of it is finite any more.
            The states at their ends, ``(blocks, capacity, *state)``. What the next call goes on
            from.
        """
        spare = self.capacity - len(lengths)
        frames, states, carried = on_user_clock(
            lambda *given: jax.block_until_ready(self.compiled(*given)),
            y0,
            args,
            np.pad(ts, (0, spare)),
            np.pad(lengths, (0, spare), constant_values=1.0),
            np.int64(len(lengths)),
            np.int64(steps),
            np.int64(count),
            np.bool_(carried is None),
            self.nothing_carried if carried is None else carried,
        )
        return np.asarray(frames), np.asarray(states), carried

    def calls(self, steps: int, frames: np.ndarray) -> np.ndarray | None:
        """How often runs of so many frames each evaluate the right-hand side, if it is known."""
        if self.evaluations is None:
            return None
        to_start, per_step, per_sample = self.evaluations
        return to_start + (per_step * steps + per_sample) * frames

    def take_compile_seconds(self) -> float:
        """The seconds that compiling took; 0 for every later use of the program."""
        seconds, self.compile_seconds = self.compile_seconds, 0.0
        return seconds


class Slot:
    """Where a program is kept; of several threads that ask for it one compiles it."""

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self.program: Program | None = None


@functools.lru_cache(maxsize=256)
def slot(family: Family, capacity: int, blocks: int) -> Slot:
    """The slot of a program; those used last are kept."""
    del family, capacity, blocks
    return Slot()


def program(family: Family, capacity: int, blocks: int) -> Program:
    """The program for so many frames and blocks, compiled where that has not been done."""
    own = slot(family, capacity, blocks)
    with own.lock:
        if own.program is None:
            own.program = _compiled(family, capacity, blocks)
        return own.program


def _compiled(family: Family, capacity: int, blocks: int) -> Program:
    """Compile; the numbers of steps, frames and blocks that are run are run-time values."""
    started = time.perf_counter()
    methods = _Methods(family)

    def run(
        y0: Any,
        args: Any,
        ts: Any,
        lengths: Any,
        frames: Any,
        steps: Any,
        count: Any,
        fresh: Any,
        carried: Any,
    ) -> Any:
        def one_block(block: Any, everything: tuple) -> tuple:
            done, states, carried = everything
            own = jax.tree.map(lambda leaf: leaf[block], args)
            frame, own_states, own_carried = frames_of(
                y0[block], own, jax.tree.map(lambda leaf: leaf[block], carried)
            )
            return (
                done.at[block].set(frame),
                states.at[block].set(own_states),
                jax.tree.map(lambda all, new: all.at[block].set(new), carried, own_carried),
            )

        def frames_of(y0: Any, args: Any, carried: Any) -> tuple:
            def steps_of(carried: Any, args: Any, start: Any, dt: Any, steps: Any) -> Any:
                def one_step(i: Any, carried: Any) -> Any:
                    return methods.step(args, start + i * dt, carried, dt)

                return jax.lax.fori_loop(0, steps, one_step, carried)

            def one_frame(loop: tuple) -> tuple:
                frame, carried, states, _ = loop
                dt = lengths[frame] / steps
                carried = in_one_kernel(steps_of, carried, args, ts[frame], dt, steps)
                y = methods.state(args, ts[frame + 1], carried, dt)
                y = jnp.stack(tuple(y)) if isinstance(y, Phase) else y
                states = jax.lax.dynamic_update_index_in_dim(states, y, frame, 0)
                return frame + 1, carried, states, going_on(y)

            def more(loop: tuple) -> Any:
                frame, _, _, finite = loop
                return (frame < frames) & finite

            start = Phase(y0[0], y0[1]) if family.mechanics else y0
            begun = methods.init(args, ts[0], start, lengths[0] / steps)
            carried = jax.tree.map(lambda new, old: jnp.where(fresh, new, old), begun, carried)
            states = jnp.zeros((capacity, *y0.shape), y0.dtype)
            frame, carried, states, _ = jax.lax.while_loop(
                more, one_frame, (0, carried, states, jnp.asarray(True))
            )
            return frame, states, carried

        def going_on(y: Any) -> Any:
            """Whether a run of the block is still finite."""
            return jnp.any(jnp.all(jnp.isfinite(y).reshape(-1, family.layout.lanes), axis=0))

        if blocks == 1:
            # Quicker to compile.
            alone = frames_of(*jax.tree.map(lambda leaf: leaf[0], (y0, args, carried)))
            return jax.tree.map(lambda leaf: jnp.asarray(leaf)[None], alone)
        nothing = jnp.zeros(blocks, jnp.int64), jnp.zeros((blocks, capacity, *y0.shape[1:]))
        return jax.lax.fori_loop(0, count, one_block, (*nothing, carried))

    def in_blocks(leaf: Any) -> jax.ShapeDtypeStruct:
        return shape_of((blocks, *leaf.shape), leaf.dtype)

    evaluations, carried = methods.calls()
    carried = jax.tree.map(in_blocks, carried)
    whole, truth = shape_of((), np.int64), shape_of((), np.bool_)
    compiled = (
        jax.jit(run)
        .lower(
            in_blocks(family.y0),
            jax.tree.map(in_blocks, methods.args),
            shape_of((capacity + 1,)),
            shape_of((capacity,)),
            *(whole, whole, whole, truth),
            carried,
        )
        .compile()
    )
    nothing = jax.tree.map(lambda leaf: np.zeros(leaf.shape, leaf.dtype), carried)
    return Program(compiled, capacity, nothing, evaluations, time.perf_counter() - started)


def shape_of(shape: tuple[int, ...], dtype: Any = np.float64) -> jax.ShapeDtypeStruct:
    """What stands for an array while nothing is computed."""
    return jax.ShapeDtypeStruct(shape, dtype)


class _Methods:
    """`init`, `step` and `state` of a stepper, on blocks of a family: ``(args, t, y, dt)``."""

    def __init__(self, family: Family):
        self._family = family
        self._calls, self._looped = 0, False
        self.args = jax.tree.unflatten(family.args_tree, family.args_leaves)
        stepper = family.method.stepper
        self._turned = is_turned(stepper, family.mechanics)
        self.init = self._on_blocks(stepper.init)
        self.step = self._on_blocks(stepper.step)
        self.state = self._on_blocks(stepper.state)

    def calls(self) -> tuple[tuple[int, int, int] | None, Any]:
        """How often each calls the right-hand side, and the shapes of what is carried."""
        y0: Any = self._family.y0
        if self._family.mechanics:
            half = shape_of(y0.shape[1:], y0.dtype)
            y0 = Phase(half, half)
        counts: list[int] = []

        def shapes_of(method: Callable, y: Any) -> Any:
            result = jax.eval_shape(method, self.args, shape_of(()), y, shape_of(()))
            counts.append(self._calls)
            return result

        carried = shapes_of(self.init, y0)
        shapes_of(self.step, carried)
        shapes_of(self.state, carried)
        to_start, per_step, per_sample = counts
        return None if self._looped else (to_start, per_step, per_sample), carried

    def _on_blocks(self, method: Callable) -> Callable:
        family = self._family

        def on_one(args: Any, t: Any, y: Any, dt: Any) -> Any:
            self._calls = 0
            outside = get_opaque_trace_state()

            def counted(function: Callable) -> Callable:
                def call(t: Any, state: Any, *others: Any) -> Any:
                    self._calls += 1
                    self._looped |= get_opaque_trace_state() != outside
                    # What the first stage reads is stored anyway, as the step's input.
                    state = stored(state, always) if self._calls > 1 else state
                    return function(t, state, *others)

                return call

            always = dt > 0
            bound = system(family.rhs, family.mechanics, args, counted=counted, turned=self._turned)
            return on_user_clock(method, bound, t, y, dt)

        def turned(args: Any, t: Any, y: Any, dt: Any) -> Any:
            dim, nodes = family.y0.shape[1:3]
            return on_stored(on_one, (nodes, dim))(args, t, y, dt)

        on_one_state = turned if self._turned else on_one
        if family.layout.lanes == 1 or family.layout.nodes is not None:
            return on_one_state
        return jax.vmap(on_one_state, in_axes=(-1, None, -1, None), out_axes=-1)
