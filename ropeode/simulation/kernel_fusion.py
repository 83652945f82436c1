"""Loops that XLA compiles into one function for the processor.

XLA runs a loop on the processor as a list of small functions, which it calls one after the
other in each iteration. For a rope of 16 nodes these calls take longer than the arithmetic.
XLA also knows how to make one function of a whole loop, and does so with loops that touch less
than a kibibyte (jaxlib 0.12: also with far larger ones). The marks that it then puts on a loop can
be put there from outside as well.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jax.experimental.xla_metadata import set_xla_metadata
from jax.extend.core import ClosedJaxpr, jaxpr_as_fun

from ropeode.problems.nested_jaxprs import equations, inside
from ropeode.simulation.transposes import COMPONENTWISE

# What XLA's emitter for one function makes code for by itself. Others call into libraries, or
# run on several cores, and have to stay outside.
_PRIMITIVES = COMPONENTWISE.union(
    ("broadcast_in_dim", "cbrt", "concatenate", "dynamic_slice", "dynamic_update_slice", "iota"),
    ("pad", "reduce_and", "reduce_max", "reduce_min", "reduce_or", "reduce_sum", "reshape", "rev"),
    ("slice", "split", "squeeze", "stack", "stop_gradient", "tile", "transpose", "unstack"),
)
# These hold others, which are looked at in their turn.
_CONTAINERS = frozenset(
    ("cond", "custom_jvp_call", "custom_vjp_call", "jit", "pjit", "scan", "while")
)
# Of so many numbers XLA splits them, in a way that its emitter for one function cannot.
_REDUCTIONS, _LONGEST = frozenset(("reduce_max", "reduce_min", "reduce_sum")), 2048
# Above this many bytes the arithmetic outweighs the calls, and several cores may share it.
_LARGEST = 1024 * 1024


def in_one_kernel(loop: Callable, *inputs: Any) -> Any:
    """``loop(*inputs)``, compiled into one function where that is possible and pays.

    Arguments:
        loop: written in JAX, with a loop inside; called while something is traced.
        inputs: pytrees of arrays and numbers; whole ones below 2^53.
    """
    leaves = [jnp.asarray(leaf) for leaf in jax.tree.leaves(inputs)]
    traced, shape = jax.make_jaxpr(loop, return_shape=True)(*inputs)
    size = sum(leaf.size * leaf.dtype.itemsize for leaf in leaves)
    if jax.default_backend() != "cpu" or size > _LARGEST or not _can_be_one(traced):
        return loop(*inputs)

    # In one array: XLA ends the process where the function has a parameter that nothing reads.
    def unpacked(packed: Any) -> list[Any]:
        ends = itertools.accumulate(leaf.size for leaf in leaves)
        parts = [
            packed[end - leaf.size : end].reshape(leaf.shape).astype(leaf.dtype)
            for leaf, end in zip(leaves, ends, strict=True)
        ]
        return jaxpr_as_fun(traced)(*parts)

    packed = jnp.concatenate([leaf.reshape(-1).astype(jnp.float64) for leaf in leaves])
    results: Any = set_xla_metadata(
        jax.jit(unpacked)(packed), xla_cpu_small_call="true", inlineable="false"
    )
    return jax.tree.unflatten(jax.tree.structure(shape), results)


def _can_be_one(traced: ClosedJaxpr) -> bool:
    """Whether all that is computed is on the list."""
    return all(
        ((name := each.primitive.name) in _PRIMITIVES or (name in _CONTAINERS and inside(each)))
        and (
            name not in _REDUCTIONS
            or math.prod(getattr(each.invars[0].aval, "shape", ())) <= _LONGEST
        )
        for each in equations(traced)
    )
