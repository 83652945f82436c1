"""Steps written for positions ``(nodes, dim)``, run on positions ``(dim, nodes)``.

Users write ``(nodes, dim)``; vector units want the long axis last. Turning the arrays at every
call of the forces costs two to three times the run time of a small rope. Most of what a step does
it does to each component alike, and then the turning cancels: here it is carried through those
operations, and only done where something else needs it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ropeode.problems.nested_jaxprs import evaluated, inside

# What acts on each component alike; all operands have one shape, or are single numbers.
# fmt: off
COMPONENTWISE = frozenset((
    "abs", "add", "add_any", "and", "atan", "atan2", "ceil", "clamp", "convert_element_type",
    "copy", "cos", "cosh", "div", "eq", "exp", "exp2", "expm1", "floor", "ge", "gt", "integer_pow",
    "is_finite", "le", "log", "log1p", "log2", "logistic", "lt", "max", "min", "mul", "ne", "neg",
    "not", "one_minus_square", "optimization_barrier", "or", "polynomial", "pow", "rem", "round",
    "rsqrt", "select_n", "sign", "sin", "sinh", "sqrt", "square", "sub", "tan", "tanh", "xor",
))
# fmt: on
# These hold a function, which is looked into.
_CALLS = ("jit", "pjit", "custom_jvp_call")


class _Turned(NamedTuple):
    """An array that is stored with its two axes exchanged."""

    stored: Any

    @property
    def ndim(self) -> int:
        return 2


def on_stored(function: Callable, shape: tuple[int, ...]) -> Callable:
    """A function of positions ``(nodes, dim)`` as one of positions ``(dim, nodes)``.

    Arguments:
        function: ``function(args, t, carried, dt)`` in JAX; all arrays of the given shape in
            `carried` and in the result are positions, velocities or the like.
        shape: ``(nodes, dim)``.
    """

    def turned(leaf: Any) -> Any:
        seen = jax.ShapeDtypeStruct(shape, leaf.dtype)
        return seen if np.shape(leaf) == shape[::-1] else leaf

    def call(args: Any, t: Any, carried: Any, dt: Any) -> Any:
        seen = jax.tree.map(turned, carried)
        traced, out = jax.make_jaxpr(function, return_shape=True)(args, t, seen, dt)
        leaves = [
            _Turned(leaf) if isinstance(view, jax.ShapeDtypeStruct) else leaf
            for leaf, view in zip(
                jax.tree.leaves((args, t, carried, dt)),
                jax.tree.leaves((args, t, seen, dt)),
                strict=True,
            )
        ]
        results = evaluated(traced, leaves, _applied)
        stored = [
            _stored(each) if np.shape(view) == shape else _plain(each)
            for each, view in zip(results, jax.tree.leaves(out), strict=True)
        ]
        return jax.tree.unflatten(jax.tree.structure(out), stored)

    return call


def _plain(value: Any) -> Any:
    return value.stored.T if isinstance(value, _Turned) else value


def _stored(value: Any) -> Any:
    return value.stored if isinstance(value, _Turned) else jnp.transpose(value)


def _applied(equation: Any, operands: list[Any]) -> list[Any]:
    """The results of one operation."""
    name, params = equation.primitive.name, equation.params
    if name == "transpose" and tuple(params["permutation"]) == (1, 0):
        (operand,) = operands
        return [operand.stored if isinstance(operand, _Turned) else _Turned(operand)]
    if not any(isinstance(each, _Turned) for each in operands):
        return _bound(equation, operands, params)
    if name in COMPONENTWISE:
        stored = [each if np.ndim(each) == 0 else _stored(each) for each in operands]
        return [_Turned(each) for each in _bound(equation, stored, params)]
    if name in _CALLS:
        return evaluated(inside(equation)[0], operands, _applied)
    return _bound(equation, [_plain(each) for each in operands], params)


def _bound(equation: Any, operands: list[Any], params: Any) -> list[Any]:
    # A pair with functions before JAX 0.10.
    bound = equation.primitive.get_bind_params(params)
    functions, params = bound if isinstance(bound, tuple) else ((), bound)
    results = equation.primitive.bind(*functions, *operands, **params)
    return list(results) if equation.primitive.multiple_results else [results]
