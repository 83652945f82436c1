"""Which entries of the Jacobian of a large problem are not zero."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from scipy import sparse

from ropeode.precision import in_float64
from ropeode.problems import Problem, random_states
from ropeode.references.solvers.family import Family
from ropeode.references.solvers.solver import SCIPY_BDF

# Columns of one call.
_COLUMNS = 256
# A Jacobian with more of its entries is factored as slowly as a dense one.
_DENSE = 0.05
_patterns: dict[tuple, Any] = {}
_MOST_KEPT = 8


@in_float64
def sparsity(problem: Problem) -> Any:
    """The pattern of a Jacobian at a few random states, as a sparse matrix of ones.

    A wrong pattern costs implicit solvers steps, and nothing of their accuracy: Newton's method
    finds the same root with another matrix, or none.

    Arguments:
        problem: with a right-hand side in JAX.

    Returns:
        None where the Jacobian is not sparse.
    """
    leaves = jax.tree.leaves(problem.args)
    family = Family.of(problem, SCIPY_BDF, 1)
    numbers = (problem.y0, problem.ts[[0, -1]], *leaves)
    key = family, *(np.asarray(each).tobytes() for each in numbers)
    if key not in _patterns:
        if len(_patterns) >= _MOST_KEPT:
            _patterns.clear()
        _patterns[key] = _pattern(problem, _columns(family), leaves)
    return _patterns[key]


def _pattern(problem: Problem, columns: Callable, leaves: Any) -> Any:
    size, found, total = problem.y0.size, [], 0
    for first in range(0, size, _COLUMNS):
        block = np.zeros((_COLUMNS, size), dtype=bool)
        for t, y in random_states(problem):
            block |= np.asarray(columns(t, y.reshape(-1), leaves, first))
        found.append(sparse.csr_array(block[: size - first]))
        total += found[-1].nnz
        if total > _DENSE * size**2:
            return None
    return sparse.csc_matrix(sparse.vstack(found).T, dtype=np.float64)


@functools.lru_cache(maxsize=16)
def _columns(family: Family) -> Callable:
    """A function that says of some columns, from a given one on, which entries are not zero."""

    def columns(t: Any, y: Any, leaves: Any, first: Any) -> Any:
        def column(index: Any) -> Any:
            direction = jnp.where(jnp.arange(y.size) == index, 1.0, 0.0)
            return jax.jvp(lambda y: family.field(t, y, leaves), (y,), (direction,))[1]

        # What is not a number may be anything.
        return jax.vmap(column)(first + jnp.arange(_COLUMNS)) != 0.0

    return jax.jit(columns)
