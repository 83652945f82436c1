"""The largest number of a row, as XLA can compute it inside one function for the processor."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp

# XLA 0.10 splits reductions of some thousand numbers, which its emitter for one function cannot.
_MOST = 1024


def largest(rows: Any) -> Any:
    """The largest number of each column.

    Long columns are folded first: to each number of the first half one of the second half.

    Arguments:
        rows: ``(rows, columns)``.
    """
    while rows.shape[0] > 1 and rows.size > _MOST:
        half = (rows.shape[0] + 1) // 2
        rows = jnp.maximum(rows[:half], rows[-half:])
    return jnp.max(rows, axis=0)
