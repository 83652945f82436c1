"""The compiled driver: blocks of runs, each a loop over frames around a loop over steps."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.extend.core import get_opaque_trace_state

from ropeode.cache import Source
from ropeode.simulation.jumps import own_side
from ropeode.simulation.kernel_fusion import in_one_kernel
from ropeode.simulation.method import Family
from ropeode.simulation.system import is_turned, positions_last, stored, system
from ropeode.simulation.trajectory import Iterations
from ropeode.simulation.transposes import on_stored
from ropeode.simulation.user_clock import on_user_clock
from ropeode.steppers import Phase


def source_of(family: Family, capacity: int, blocks: int) -> Source:
    """What the program of a family is compiled from.

    The numbers of steps, and of frames of each block, are run-time values.

    Arguments:
        family: of runs.
        capacity: the most frames that it runs in one go.
        blocks: how many it has.
    """
    methods = _Methods(family)

    def run(
        y0: Any, args: Any, ts: Any, lengths: Any, frames: Any, steps: Any, fresh: Any, carried: Any
    ) -> Any:
        def of_block(block: tuple) -> tuple:
            y0, args, frames, carried = block

            def steps_of(carried: Any, args: Any, start: Any, dt: Any, steps: Any) -> Any:
                def one_step(i: Any, carried: Any) -> Any:
                    return positions_last(methods.step(args, start + i * dt, carried, dt), dt > 0)

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
            return frame, states, methods.iterations(args, carried), carried

        def going_on(y: Any) -> Any:
            """Whether a run of the block is still finite."""
            return jnp.any(jnp.all(jnp.isfinite(y).reshape(-1, family.layout.lanes), axis=0))

        return jax.lax.map(of_block, (y0, args, frames, carried))

    def in_blocks(leaf: Any) -> jax.ShapeDtypeStruct:
        return shape_of((blocks, *leaf.shape), leaf.dtype)

    evaluations, carried = methods.calls()
    carried = jax.tree.map(in_blocks, carried)
    whole, truth = shape_of((), np.int64), shape_of((), np.bool_)
    inputs = (
        in_blocks(family.y0),
        jax.tree.map(in_blocks, methods.args),
        shape_of((capacity + 1,)),
        shape_of((capacity,)),
        *(in_blocks(whole), whole, truth),
        carried,
    )
    shapes = [[leaf.shape, str(leaf.dtype)] for leaf in jax.tree.leaves(carried)]
    return Source(run, inputs, {"evaluations": evaluations, "carried": shapes})


class _Methods:
    """`init`, `step` and `state` of a stepper, on blocks of a family: ``(args, t, y, dt)``."""

    def __init__(self, family: Family):
        self._family = family
        self._calls, self._looped, self._counts_loops = 0, False, False
        self.args = jax.tree.unflatten(family.args_tree, family.args_leaves)
        stepper = family.method.stepper
        self._turned = is_turned(stepper, family.mechanics)
        self.init = self._on_blocks(stepper.init)
        self.step = self._on_blocks(stepper.step)
        self.state = self._on_blocks(stepper.state, ahead=-0.5)
        self._iterations = self._on_blocks(lambda _, t, carried, dt: self._said_of(carried))

    def _said_of(self, carried: Any) -> Iterations:
        stepper = self._family.method.stepper
        jacobians = stepper.jacobian_evaluations(carried)
        self._counts_loops = jacobians is not None
        return Iterations(stepper.solved(carried), jacobians if self._counts_loops else 0)

    def iterations(self, args: Any, carried: Any) -> Iterations:
        """What the stepper says of them, of each run of a block."""
        lanes = (self._family.layout.lanes,)
        solved, jacobians = self._iterations(args, 0.0, carried, 1.0)
        return Iterations(
            jnp.broadcast_to(jnp.asarray(solved, bool).reshape(-1), lanes),
            jnp.broadcast_to(jnp.asarray(jacobians, jnp.int64).reshape(-1), lanes),
        )

    def calls(self) -> tuple[tuple[int, int, int] | None, Any]:
        """How often each calls the right-hand side, and the shapes of what is carried.

        Calls in loops are left to the stepper; None where it does not count them.
        """
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
        shapes_of(lambda args, t, carried, dt: self.iterations(args, carried), carried)
        known = self._counts_loops or not self._looped
        return (to_start, per_step, per_sample) if known else None, carried

    def _on_blocks(self, method: Callable, ahead: float = 0.5) -> Callable:
        """A method on blocks, which is called so many steps before the middle of its step."""
        family = self._family

        def on_one(args: Any, t: Any, y: Any, dt: Any) -> Any:
            self._calls = 0
            outside = get_opaque_trace_state()
            seen = own_side(family.sides, t + ahead * dt)

            def counted(function: Callable) -> Callable:
                def call(t: Any, state: Any, *others: Any) -> Any:
                    inside = get_opaque_trace_state() != outside
                    self._calls += not inside
                    self._looped |= inside
                    # What the first stage reads is stored anyway, as the step's input.
                    state = stored(state, always) if self._calls > 1 and not inside else state
                    return function(seen(t), state, *others)

                return call

            always = dt > 0
            bound = system(family.rhs, family.mechanics, args, counted=counted, turned=self._turned)
            bound = dataclasses.replace(bound, once=lambda value: stored(value, always))
            return on_user_clock(method, bound, t, y, dt)

        def turned(args: Any, t: Any, y: Any, dt: Any) -> Any:
            dim, nodes = family.y0.shape[1:3]
            return on_stored(on_one, (nodes, dim))(args, t, y, dt)

        on_one_state = turned if self._turned else on_one
        if family.layout.lanes == 1 or family.layout.nodes is not None:
            return on_one_state
        return jax.vmap(on_one_state, in_axes=(-1, None, -1, None), out_axes=-1)


def shape_of(shape: tuple[int, ...], dtype: Any = np.float64) -> jax.ShapeDtypeStruct:
    """What stands for an array while nothing is computed."""
    return jax.ShapeDtypeStruct(shape, dtype)
