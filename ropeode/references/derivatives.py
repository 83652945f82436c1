"""Derivatives by time along solutions, by automatic differentiation."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ropeode.precision import in_float64
from ropeode.problems import Problem, compiled

_BLOCK = 128


@in_float64
def time_derivatives(
    problem: Problem, times: np.ndarray, states: np.ndarray, count: int
) -> np.ndarray:
    """States and their derivatives along the solutions, ``(times, 1 + count, *state)``.

    ``y' = f``, ``y'' = f_t + f_y f`` and so on: each is the derivative of the one before along
    the direction ``(1, f)``. At a jump time they are those behind it.

    Arguments:
        problem: whose right-hand side is differentiated.
        times: ``(times,)``.
        states: ``(times, *state)``.
        count: of derivatives, 1 or more; of a right-hand side in Python only the first is known.
    """
    count = 1 if problem.in_python else count
    behind = np.where(np.isin(times, problem.jump_times), np.nextafter(times, np.inf), times)
    slopes = compiled(_slopes, problem.rhs, count)
    blocks = []
    for first in range(0, len(times), _BLOCK):
        # The last state fills the block up, so that one compilation serves all.
        rows = np.minimum(np.arange(first, first + _BLOCK), len(times) - 1)
        block = np.asarray(slopes(behind[rows], states[rows], problem.args))
        blocks.append(block[: len(times) - first])
    return np.concatenate([states[:, None], np.concatenate(blocks)], axis=1)


def _slopes(rhs: Callable, count: int) -> Callable:
    def slopes(t: Any, y: Any, args: Any) -> Any:
        t = jnp.asarray(t)

        def field(t: Any, y: Any) -> Any:
            return rhs(t, y, args)

        def along(function: Callable) -> Callable:
            def slope(t: Any, y: Any) -> Any:
                return jax.jvp(function, (t, y), (jnp.ones_like(t), field(t, y)))[1]

            return slope

        functions = [field]
        for _ in range(count - 1):
            functions.append(along(functions[-1]))
        return jnp.stack([function(t, y) for function in functions])

    return jax.vmap(slopes, in_axes=(0, 0, None))
