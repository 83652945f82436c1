"""A reference between its samples: piecewise polynomials with an error bound of their own."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
import numpy as np

from ropeode.arrays import real_array
from ropeode.equality import ByContent
from ropeode.precision import in_float64
from ropeode.problems import Problem
from ropeode.validation import bad_value

if TYPE_CHECKING:
    from scipy.interpolate import BPoly

_BLOCK = 128


@dataclasses.dataclass(frozen=True, eq=False)
class Dense(ByContent):
    """States at any time from the first node to the last.

    Between two nodes the solution is the polynomial that has the states and the derivatives
    at both: two-point Hermite interpolation, of order ``2 * (1 + derivatives)``. Where the
    right-hand side jumps there are two nodes, the jump time and the last number before it.

    Arguments:
        times: of the nodes, increasing, ``(nodes,)``. All samples up to the last are nodes.
        derivatives: ``(nodes, 1 + derivatives, *state)``; the states come first, then their
            derivatives by time.
        bounds: for each quantity the estimated error bound, in the largest node's norm, from
            the node before up to each node, ``(nodes,)``. It never falls in time.

    Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, section II.6.
    """

    times: np.ndarray
    derivatives: np.ndarray
    bounds: Mapping[str, np.ndarray]

    @property
    def end(self) -> float:
        """The last time that it covers."""
        return float(self.times[-1])

    @property
    def order(self) -> int:
        """Of the interpolation: its error falls by this power of the distance of the nodes."""
        return 2 * self.derivatives.shape[1]

    def at(self, times: Any) -> np.ndarray:
        """States, as `Reference.at` has them; at a node the node's own, to the last bit."""
        return self._polynomial(self._checked(times))

    def bound_at(self, times: Any, quantity: str) -> np.ndarray:
        """The estimated error bound of a quantity, as `Reference.bound_at` has it."""
        return self.bounds[quantity][np.searchsorted(self.times, self._checked(times))]

    def until(self, end: float) -> Dense:
        """The same up to the node at the time `end`."""
        kept = int(np.searchsorted(self.times, end)) + 1
        return Dense(
            self.times[:kept],
            self.derivatives[:kept],
            {quantity: series[:kept] for quantity, series in self.bounds.items()},
        )

    def _checked(self, times: Any) -> np.ndarray:
        checked = np.atleast_1d(real_array("times", times))
        start, end = self.times[0], self.times[-1]
        outside = checked[(checked < start) | (checked > end)]
        if checked.ndim != 1 or len(outside):
            raise bad_value(
                "times",
                float(outside[0]) if len(outside) else checked.shape,
                f"a number, or a list of numbers, from {start:g} to {end:g}, the span in "
                "which the reference is trusted at any time",
                "leave out the others, or compute a reference that goes further",
            )
        return checked

    @functools.cached_property
    def _polynomial(self) -> BPoly:
        return hermite(self.times, self.derivatives)


def hermite(times: np.ndarray, derivatives: np.ndarray) -> BPoly:
    """The piecewise polynomial with given derivatives at its nodes.

    The same as SciPy's `BPoly.from_derivatives`, which builds one piece after the other. Here
    it builds the pieces of the unit interval only; all others are sums of these, at once.

    Arguments:
        times: of the nodes, increasing.
        derivatives: ``(nodes, 1 + derivatives, *state)``.
    """
    count = derivatives.shape[1]
    lengths = np.diff(times).reshape(-1, 1, *[1] * (derivatives.ndim - 2))
    scales = lengths ** np.arange(count).reshape(-1, *[1] * (derivatives.ndim - 2))
    ends = np.concatenate([derivatives[:-1] * scales, derivatives[1:] * scales], axis=1)
    return _bernstein()(np.einsum("cd,pd...->cp...", _unit_pieces(count), ends), times)


def _bernstein() -> type[BPoly]:
    """Imported here, because few references are dense and it takes long."""
    from scipy.interpolate import BPoly

    return BPoly


@functools.cache
def _unit_pieces(count: int) -> np.ndarray:
    """Bernstein coefficients of pieces from 0 to 1, each with one derivative 1, the others 0."""
    one = np.eye(2 * count)
    return _bernstein().from_derivatives([0.0, 1.0], [one[:count], one[count:]]).c[:, 0]


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
    slopes = _slopes(problem.rhs, count)
    blocks = []
    for first in range(0, len(times), _BLOCK):
        # The last state fills the block up, so that one compilation serves all.
        rows = np.minimum(np.arange(first, first + _BLOCK), len(times) - 1)
        block = np.asarray(slopes(behind[rows], states[rows], problem.args))
        blocks.append(block[: len(times) - first])
    return np.concatenate([states[:, None], np.concatenate(blocks)], axis=1)


@functools.lru_cache(maxsize=16)
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

    return jax.jit(jax.vmap(slopes, in_axes=(0, 0, None)))
