"""Right-hand sides for solvers that call one: in NumPy (or plain Python), by Numba, by JAX.

All take ``(t, y)`` with a flat state and return its derivative. Which problem it is follows from
its parameters.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import numpy as np

from against.stepping import numbers
from against.timing import Peers
from reference import numpy_rhs
from ropeode import Problem

Rhs = Callable[[float, np.ndarray], Any]
# Several units of rounding of its largest number.
_AGREEMENT = 1e-13


class Compiled(NamedTuple):
    """A right-hand side.

    Fields:
        name: what it is written in.
        rhs: the function.
        compile_seconds: until it gave its first answer.
    """

    name: str
    rhs: Rhs
    compile_seconds: float


def plain(problem: Problem) -> Rhs:
    """As a user of SciPy writes it: arrays for a rope, plain numbers for two or four."""
    kind = problem.parameters["kind"]
    if kind == "rope":
        return numpy_rhs(problem)
    if kind == "kepler":

        def kepler(t: float, y: np.ndarray) -> list[float]:
            x0, x1, v0, v1 = y.tolist()
            cubed = (x0 * x0 + x1 * x1) ** 1.5
            return [v0, v1, -x0 / cubed, -x1 / cubed]

        return kepler
    epsilon = float(problem.args)

    def van_der_pol(t: float, y: np.ndarray) -> list[float]:
        x, v = y.tolist()
        return [v, ((1.0 - x * x) * v - x) / epsilon]

    return van_der_pol


def by_numba(problem: Problem) -> Rhs:
    """The same as loops, compiled at the first call."""
    from numba import njit

    kind = problem.parameters["kind"]
    if kind == "rope":
        from against.numba_rope import accelerate

        nodes, given = problem.y0.shape[-1], numbers(problem)

        @njit(error_model="numpy")
        def rope(t, y):
            dy = np.empty_like(y)
            state, slope = y.reshape((2, 2, nodes)), dy.reshape((2, 2, nodes))
            slope[0] = state[1]
            accelerate(state[0], state[1], slope[1], np.zeros((2, nodes + 1)), *given)
            return dy

        return rope
    if kind == "kepler":

        @njit(error_model="numpy")
        def kepler(t, y):
            cubed = (y[0] * y[0] + y[1] * y[1]) ** 1.5
            return np.array([y[2], y[3], -y[0] / cubed, -y[1] / cubed])

        return kepler
    epsilon = float(problem.args)

    @njit(error_model="numpy")
    def van_der_pol(t, y):
        return np.array([y[1], ((1.0 - y[0] * y[0]) * y[1] - y[0]) / epsilon])

    return van_der_pol


def by_jax(problem: Problem) -> Rhs:
    """The problem's own, jitted; its numbers are compiled in."""

    def field(t: Any, y: Any) -> Any:
        return problem.rhs(t, y.reshape(problem.y0.shape), problem.args).reshape(-1)

    compiled = jax.jit(field).lower(np.float64(0.0), problem.y0.reshape(-1)).compile()
    return lambda t, y: np.asarray(compiled(np.float64(t), y))


def quickest_first(problem: Problem, peers: Peers) -> list[Compiled]:
    """By Numba (by JAX without it), then in NumPy; each gives what the problem's own gives.

    Raises:
        SystemExit: one does not.
    """
    ways = {"Numba": by_numba} if peers.get("numba", "numba") else {"JAX": by_jax}
    ways["NumPy" if problem.parameters["kind"] == "rope" else "Python"] = plain
    y = problem.y0.reshape(-1) + np.linspace(0.0, 0.1, problem.y0.size)
    known = np.asarray(problem.rhs(0.0, y.reshape(problem.y0.shape), problem.args)).reshape(-1)
    # Stiff springs multiply the rounding of positions.
    size = max(1.0, *np.abs(known), _stiffness(problem) * np.max(np.abs(y)))
    found = []
    for name, way in ways.items():
        started = time.perf_counter()
        rhs = way(problem)
        apart = np.max(np.abs(np.asarray(rhs(0.0, y)) - known))
        seconds = time.perf_counter() - started
        if not apart <= _AGREEMENT * size:
            raise SystemExit(f"{problem.name}: the {name} right-hand side is {apart:.1e} away")
        found.append(Compiled(name, rhs, 0.0 if way is plain else seconds))
    return found


def _stiffness(problem: Problem) -> float:
    return float(np.max(getattr(problem.args, "stiffness", 0.0)))
