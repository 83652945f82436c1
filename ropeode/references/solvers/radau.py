"""One step of Radau IIA of order 9, for stiff problems.

The increments z of its stages solve ``z = h A f(y + z)``. A simplified Newton iteration finds them:
one exact Jacobian for each step, and the system of all stages taken apart into one real and two
complex ones of the state's size. The iteration goes on until rounding ends it, because the method
is far more accurate than its error estimate, which is of order 5.

Source: Hairer and Wanner, Stiff differential equations solved by Radau methods, Journal of
Computational and Applied Mathematics 111, 1999; Solving Ordinary Differential Equations II,
section IV.8.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.scipy.linalg import lu_factor, lu_solve
from scipy.special import roots_jacobi, roots_legendre

STAGES = 5
_EPS = float(np.finfo(np.float64).eps)
_MOST_ITERATIONS = 12
# Of the state: an iteration whose steps grow at this size has met rounding, and not diverged.
_ROUNDING = 1e-9


def _collocation(stages: int) -> tuple[np.ndarray, np.ndarray]:
    """The nodes of Radau IIA, and its matrix: integrals of Lagrange's polynomials up to each."""
    nodes = np.append((1.0 + roots_jacobi(stages - 1, 1.0, 0.0)[0]) / 2.0, 1.0)
    points, weights = roots_legendre(stages)
    at = np.multiply.outer(nodes, (1.0 + points) / 2.0)
    matrix = np.empty((stages, stages))
    for j in range(stages):
        others = np.delete(nodes, j)
        values = np.prod((at[..., None] - others) / (nodes[j] - others), axis=-1)
        matrix[:, j] = nodes / 2.0 * (values @ weights)
    return nodes, matrix


def _refined_inverse(matrix: np.ndarray) -> np.ndarray:
    """The inverse, each entry right to its last bits."""
    inverse = np.linalg.inv(matrix).astype(np.longdouble)
    for _ in range(2):
        inverse += inverse @ (np.eye(len(matrix)) - matrix.astype(np.longdouble) @ inverse)
    return inverse.astype(np.float64)


_NODES, _A = _collocation(STAGES)
_A_INVERSE = _refined_inverse(_A)
_EIGENVALUES, _VECTORS = np.linalg.eig(_A_INVERSE)
# The real eigenvalue comes first, and one of each pair of conjugate ones serves both.
_KEPT = [i for i in np.argsort(np.imag(_EIGENVALUES)) if np.imag(_EIGENVALUES[i]) >= 0.0]
_VALUES = [np.real_if_close(_EIGENVALUES[i]) for i in _KEPT]
_ROWS = [np.real_if_close(np.linalg.inv(_VECTORS)[i]) for i in _KEPT]
_COLUMNS = [np.real_if_close(_VECTORS[:, i]) * (1.0 if i == _KEPT[0] else 2.0) for i in _KEPT]
# A formula of order `STAGES`, in which the slope at the start has the weight 1 / _VALUES[0], minus
# the method.
_POWERS = np.vander(_NODES, increasing=True).T
_ERROR = np.linalg.solve(_A.T, np.linalg.solve(_POWERS, -np.eye(STAGES)[0]))


def step(field: Callable, jacobian: Any, t0: Any, t1: Any, size: Any) -> tuple[Any, Any]:
    """The increment of the state in one step, and an estimate of its error.

    Arguments:
        field: of a time, and an increment of the state.
        jacobian: of the field at the start, ``(numbers, numbers)``.
        t0: the time at the start.
        t1: the time at the end.
        size: of the state's components, beside which rounding is measured.

    Returns:
        The increment, and its error, which is infinite where the iteration does not converge.
    """
    h = t1 - t0
    times = jnp.append(t0 + _NODES[:-1] * h, t1)
    slopes = jax.vmap(field)
    eye = jnp.eye(len(jacobian))
    factors = [lu_factor(value / h * eye - jacobian) for value in _VALUES]

    def iteration(state: Any) -> Any:
        z, before, count, _ = state
        residual = slopes(times, z) - _product(_A_INVERSE, z) / h
        change = jnp.zeros_like(z)
        for factor, row, column in zip(factors, _ROWS, _COLUMNS, strict=True):
            part = lu_solve(factor, _product(row, residual))
            change = change + jnp.real(column[:, None] * part)
        z = z + change
        moved = jnp.max(jnp.abs(change) / (size + jnp.max(jnp.abs(z), axis=0)))
        rate = moved / before
        # What is still to come of a geometric series is small enough, or rounding is in its way.
        done = (count > 0) & (moved * rate <= _EPS / 4.0 * (1.0 - rate))
        done |= (moved == 0.0) | ((rate >= 0.9) & (moved <= _ROUNDING))
        return z, moved, count + 1, jnp.where(done, 1, jnp.where(rate > 2.0, -1, 0))

    def goes_on(state: Any) -> Any:
        _, _, count, verdict = state
        return (verdict == 0) & (count < _MOST_ITERATIONS)

    zero = jnp.zeros(len(jacobian))
    first = jnp.zeros((STAGES, len(jacobian))), jnp.asarray(jnp.inf), jnp.asarray(0), jnp.asarray(0)
    z, _, _, verdict = lax.while_loop(goes_on, iteration, first)
    error = lu_solve(factors[0], field(t0, zero) + _product(_ERROR, z) / h)
    return z[-1], jnp.where(verdict == 1, error, jnp.inf)


def _product(matrix: np.ndarray, stages: Any) -> Any:
    """A matrix or a row of numbers times the stages, term by term."""
    terms = [matrix[..., i, None] * stages[i] for i in range(STAGES)]
    return sum(terms[1:], terms[0])
