"""LAPACK calls of compiled programs that do not wait for one another.

JAX 0.10 and 0.11.0 divide a large batch of matrices among the threads of XLA's pool, and the
thread that does so waits for the others. Where all of them wait, none is left that works, and the
process hangs for ever: two programs in two threads did so, and so did one program with several
such batches. Here a batch is divided into parts that are too small to be handed to other threads.
"""

from __future__ import annotations

import functools
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.interpreters import mlir

# The first version that leaves a batch to the thread that calls.
_MENDED = (0, 11, 2)
# JAX hands out batches from so many floating-point operations on, by its own estimate.
_HANDED_OUT = 200_000
# For a matrix of size n, that estimate is at most so many times n**3, three times that if complex.
_OPERATIONS = {"lu": 1, "triangular_solve": 1, "cholesky": 1}
_MOST_OPERATIONS = 10
# The last axes of the first operand that are no batch.
_RANKS = {"tridiagonal_solve": 1}
_PRIMITIVES = (
    *("cholesky", "eig", "eigh", "hessenberg", "householder_product", "lu", "ormqr", "qr"),
    *("schur", "svd", "triangular_solve", "tridiagonal", "tridiagonal_solve"),
)


def divide_batches() -> None:
    """Let what JAX compiles from now on, in this process, make small LAPACK calls.

    The results are the same to the last bit: each matrix is still given to the same function.
    """
    if jax.__version_info__ >= _MENDED:
        return
    for name in _PRIMITIVES:
        primitive = getattr(jax.lax.linalg, f"{name}_p")
        # The rule that JAX has is not public. This is for some released versions only.
        own = mlir._platform_specific_lowerings["cpu"].get(primitive)  # type: ignore[attr-defined]
        own = own or mlir._lowerings[primitive]  # type: ignore[attr-defined]
        rule = functools.partial(_lowered, name, primitive, own.rule)
        mlir.register_lowering(primitive, rule, platform="cpu")


def _lowered(name: str, primitive: Any, rule: Any, ctx: Any, *operands: Any, **params: Any) -> Any:
    """The rule of a primitive, where its batch is small; else of a loop over parts of it."""
    shapes = [each.shape for each in ctx.avals_in]
    batch = shapes[0][: len(shapes[0]) - _RANKS.get(name, 2)]
    size, most = int(np.prod(batch)), _most_at_once(name, ctx.avals_in, len(batch))
    if size <= most:
        return rule(ctx, *operands, **params)

    def in_parts(*operands: Any) -> Any:
        flat = [each.reshape(size, *each.shape[len(batch) :]) for each in operands]
        whole = size - size % most

        def one(part: Any) -> Any:
            return primitive.bind(*part, **params)

        parts = [each[:whole].reshape(-1, most, *each.shape[1:]) for each in flat]
        solved = jax.lax.map(one, parts)
        solved = jax.tree.map(lambda each: each.reshape(whole, *each.shape[2:]), solved)
        if whole < size:
            rest = one([each[whole:] for each in flat])
            solved = jax.tree.map(lambda *both: jnp.concatenate(both), solved, rest)
        return jax.tree.map(lambda each: each.reshape(*batch, *each.shape[1:]), solved)

    many = primitive.multiple_results
    return mlir.lower_fun(in_parts, multiple_results=many)(ctx, *operands)


def _most_at_once(name: str, operands: Any, batched: int) -> int:
    """So many matrices are few enough; one always is."""
    largest = max(max(each.shape[batched:], default=1) for each in operands)
    complexity = (
        3 if any(jnp.issubdtype(each.dtype, jnp.complexfloating) for each in operands) else 1
    )
    operations = complexity * _OPERATIONS.get(name, _MOST_OPERATIONS) * max(largest, 1) ** 3
    return max((_HANDED_OUT - 1) // operations, 1)


divide_batches()
