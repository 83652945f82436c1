"""Tridiagonal systems, many side by side."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp


def solve(lower: Any, diagonal: Any, upper: Any, right: Any) -> Any:
    """Solve ``lower[i] u[i-1] + diagonal[i] u[i] + upper[i] u[i+1] = right[i]``.

    By elimination without exchange of rows, which is stable for matrices that are positive
    definite or dominated by their diagonal. JAX's own `tridiagonal_solve` leaves the compiled
    program for LAPACK, one system after the other, which takes far longer than the arithmetic.

    Arguments:
        lower: below the diagonal, ``(rows, systems)``; the first is not used.
        diagonal: ``(rows, systems)``.
        upper: above the diagonal, ``(rows, systems)``; the last is not used.
        right: right-hand sides, ``(rows, systems)``.

    Source: Golub, Van Loan, Matrix Computations, section 4.3.6.
    """

    def down(above: tuple, row: tuple) -> tuple:
        ratio, value = above
        lower, diagonal, upper, right = row
        pivot = 1.0 / (diagonal - lower * ratio)
        above = upper * pivot, (right - lower * value) * pivot
        return above, above

    def up(below: Any, row: tuple) -> tuple:
        ratio, value = row
        solved = value - ratio * below
        return solved, solved

    nothing = jnp.zeros_like(right[0])
    _, rows = jax.lax.scan(down, (nothing, nothing), (lower, diagonal, upper, right))
    return jax.lax.scan(up, nothing, rows, reverse=True)[1]
