"""Linear equations whose unknowns stand in a row, each coupled to its neighbours alone."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp

# Unknowns that stand three places apart have no neighbour in common.
_COLOURS = 3


def solve_neighbours(linear: Callable[[Any], Any], right: Any) -> Any:
    """Solve ``linear(u) = right``, a linear map that couples neighbouring nodes.

    The matrix is read off the map by products with a few vectors: each has ones at every third
    node, so that each row meets one of them. Reading and solving take O(nodes) work.

    Arguments:
        linear: of arrays like `right`.
        right: ``(numbers, nodes, ropes)``, the unknowns of each node first; the systems of
            several ropes side by side are apart from each other.

    Source: Curtis, Powell, Reid, J. Inst. Math. Appl. 13 (1974).
    """
    numbers, nodes, _ = right.shape
    colour = jnp.arange(nodes) % _COLOURS
    which = jnp.arange(_COLOURS * numbers)
    of_number = which[:, None, None] % numbers == jnp.arange(numbers)[:, None]
    of_colour = which[:, None, None] // numbers == colour
    seeds = jnp.where(of_number & of_colour, 1.0, 0.0)[..., None]
    images = jax.vmap(linear)(jnp.broadcast_to(seeds, (len(which), *right.shape)))
    images = images.reshape(_COLOURS, numbers, *right.shape)

    def block(shift: int) -> Any:
        """How each node's equations, first, depend on the node so many places further on."""
        of = (colour + shift) % _COLOURS
        chosen = images[0]
        for each in range(1, _COLOURS):
            chosen = jnp.where((of == each)[:, None], images[each], chosen)
        return jnp.moveaxis(chosen, 2, 0).swapaxes(1, 2)

    solution = solve_block_tridiagonal(block(-1), block(0), block(1), jnp.moveaxis(right, 1, 0))
    return jnp.moveaxis(solution, 0, 1)


def solve_block_tridiagonal(lower: Any, diagonal: Any, upper: Any, right: Any) -> Any:
    """Solve ``lower[i] u[i-1] + diagonal[i] u[i] + upper[i] u[i+1] = right[i]``.

    By elimination, with an exchange of rows inside the blocks only: that is stable where the
    matrix is positive definite or its blocks are dominated by those on the diagonal.

    Arguments:
        lower: left of the diagonal, ``(rows, size, size, systems)``; the first is not used.
        diagonal: likewise.
        upper: right of the diagonal, likewise; the last is not used.
        right: right-hand sides, ``(rows, size, systems)``.

    Source: Golub, Van Loan, Matrix Computations, section 4.5.1.
    """

    def down(above: tuple, row: tuple) -> tuple:
        ratio, value = above
        lower, diagonal, upper, right = row
        pivot = diagonal - _product(lower, ratio)
        value = right - _product(lower, value[:, None])[:, 0]
        solved = solve_small(pivot, jnp.concatenate([upper, value[:, None]], axis=1))
        above = solved[:, :-1], solved[:, -1]
        return above, above

    def up(below: Any, row: tuple) -> tuple:
        ratio, value = row
        solved = value - _product(ratio, below[:, None])[:, 0]
        return solved, solved

    nothing = jnp.zeros_like(diagonal[0]), jnp.zeros_like(right[0])
    # What lies outside the matrix meets zeros, and must not be not-a-number.
    _, rows = jax.lax.scan(down, nothing, (lower, diagonal, upper, right))
    return jax.lax.scan(up, nothing[1], rows, reverse=True)[1]


def _product(a: Any, b: Any) -> Any:
    """Of matrices ``(n, k, systems)`` and ``(k, m, systems)``."""
    return sum(a[:, i, None] * b[None, i] for i in range(a.shape[1]))


def solve_small(matrix: Any, right: Any) -> Any:
    """Solve small dense systems, written out: no call into a library that costs more.

    By elimination; rows are exchanged pair by pair, whichever has the larger entry first.

    Arguments:
        matrix: ``(size, size, systems)``.
        right: several right-hand sides of each, ``(size, sides, systems)``.

    Source: Sorensen, IEEE Trans. Comput. C-34 (1985), on pairwise pivoting.
    """
    size = matrix.shape[0]
    # Each row from its first column on that is not eliminated yet.
    rows = list(jnp.concatenate([matrix, right], axis=1))
    for k in range(size):
        for i in range(k + 1, size):
            swap = jnp.abs(rows[i][0]) > jnp.abs(rows[k][0])
            pivot = jnp.where(swap, rows[i], rows[k])
            other = jnp.where(swap, rows[k], rows[i])
            # Both are zero where neither row has an entry in this column.
            ratio = other[0] / jnp.where(pivot[0] == 0.0, 1.0, pivot[0])
            rows[k], rows[i] = pivot, (other - ratio * pivot)[1:]
    solution: list[Any] = [None] * size
    for k in reversed(range(size)):
        known = sum((rows[k][j - k] * solution[j] for j in range(k + 1, size)), 0.0)
        solution[k] = (rows[k][size - k :] - known) / rows[k][0]
    return jnp.stack(solution)
