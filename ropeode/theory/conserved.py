"""What the exact solution of a mechanical problem conserves, near some states."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ropeode.problems import Problem, Rhs, compiled

# Of the terms that cancel: what rounding leaves of a derivative along the solution that is zero.
_ROUNDING = 1e-9
# The same of the form, of which one term is a difference.
_OF_FORM = 1e-6
# A step along the solution, for how a form changes; of the fastest mode's time.
_SHORT = 1e-4


class Conserved:
    """What the flow of a problem preserves at some states without any symmetry; found on demand.

    With the energy ``E(x, v)`` the canonical momenta are ``p = dE/dv``. (Of ``T + V`` with a
    kinetic energy T quadratic in the velocities, these are those of the Lagrangian ``T - V``.)

    Arguments:
        problem: a mechanical one.
        states: ``(states, *state)``.
        free: which coordinates can move, in the shape of the positions.
        rate: of the fastest mode, per time unit.
    """

    def __init__(self, problem: Problem, states: np.ndarray, free: np.ndarray, rate: float):
        self.problem, self.free = problem, np.tile(free.ravel(), 2)
        self._states, self._rate = states, rate

    @functools.cached_property
    def steady(self) -> bool:
        """Whether the equation does not depend on time."""
        return all(np.array_equal(self._slope(y, 0), self._slope(y, -1)) for y in self._states)

    @functools.cached_property
    def energy(self) -> bool | None:
        """Whether the energy is constant; None where the problem declares none."""
        if self.problem.energy is None:
            return None
        moved = [np.asarray(self._gradient(y)) * self._slope(y) for y in self._states]
        return self.steady and all(_cancel(terms) for terms in moved)

    @functools.cached_property
    def hamiltonian(self) -> bool:
        """Whether the form ``dx ^ dp`` is preserved."""
        return bool(self.energy) and all(self._change_of_form(y) <= _OF_FORM for y in self._states)

    @functools.cached_property
    def volume(self) -> bool:
        """Whether volume is, measured in x and p, or where these are not known in x and v."""
        if self.hamiltonian:
            return True
        return self.steady and all(
            _cancel(np.append(np.diagonal(self._derivative(y)), 0.0), self._rate)
            for y in self._states
        )

    @functools.cached_property
    def reversible(self) -> bool:
        """Whether solutions run backwards where velocities are reversed."""
        return self.steady and all(self._runs_back(y) for y in self._states)

    @functools.cached_property
    def linear(self) -> np.ndarray:
        """Which components of the sum of the momenta are constant, ``(dim,)``."""
        return self._constant(self.momenta)

    @functools.cached_property
    def angular(self) -> np.ndarray:
        """Which components of the angular momentum are, ``(1 or 3,)``; in one dimension none."""
        return self._constant(self.angular_momenta)

    def energies(self, y: np.ndarray) -> tuple[float, float]:
        """The energy of a state, and the size of its kinetic and potential parts together."""
        value, momenta = self._energy_and_momenta(y)
        return float(value), float(abs(value) + abs(np.sum(np.asarray(momenta) * y[1])))

    def momenta(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Their sum over the nodes, and its size if all had one direction."""
        each = _by_node(self.problem, np.asarray(self._energy_and_momenta(y)[1]))
        return np.sum(each, axis=0), np.sum(np.abs(each), axis=0)

    def angular_momenta(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """About the origin, and its size if all had one direction."""
        p = _by_node(self.problem, np.asarray(self._energy_and_momenta(y)[1]))
        each = _cross(_by_node(self.problem, y[0]), p)
        return np.sum(each, axis=0), np.sum(np.abs(each), axis=0)

    def form(self, y: np.ndarray) -> np.ndarray:
        """The form ``dx ^ dp`` in the coordinates that can move, ``(2 free, 2 free)``."""
        half = y.size // 2
        slopes = np.asarray(self._called(_compiled_energy(self.problem.energy)[2], y))
        in_x, in_v = slopes.reshape(half, -1)[:, :half], slopes.reshape(half, -1)[:, half:]
        form = np.block([[in_x - in_x.T, in_v], [-in_v.T, np.zeros((half, half))]])
        return form[np.ix_(self.free, self.free)]

    def _called(self, function: Callable, y: np.ndarray, sample: int = 0) -> Any:
        return function(self.problem.ts[sample], y, self.problem.args)

    def _slope(self, y: np.ndarray, sample: int = 0) -> np.ndarray:
        return np.asarray(self._called(compiled(self.problem.rhs), y, sample))

    def _derivative(self, y: np.ndarray) -> np.ndarray:
        found = np.asarray(self._called(_derivative(self.problem.rhs), y))
        return found[np.ix_(self.free, self.free)]

    def _energy_and_momenta(self, y: np.ndarray) -> Any:
        return self._called(_compiled_energy(self.problem.energy)[0], y)

    def _gradient(self, y: np.ndarray) -> Any:
        return self._called(_compiled_energy(self.problem.energy)[1], y)

    def _runs_back(self, y: np.ndarray) -> bool:
        turn = np.array([1.0, -1.0]).reshape(2, *[1] * (y.ndim - 1))
        there, back = self._slope(y), self._slope(turn * y)
        size = np.max(np.abs(there[1])) + self._rate * np.max(np.abs(y[1]))
        return bool(np.max(np.abs(back + turn * there)) <= _ROUNDING * size)

    def _change_of_form(self, y: np.ndarray) -> float:
        """How fast the solution changes it, per turn of the fastest mode, relative to it."""
        slope, form = self._derivative(y), self.form(y)
        step = _SHORT / self._rate * self._slope(y)
        along = (self.form(y + step) - self.form(y - step)) * (0.5 * self._rate / _SHORT)
        scale = scales(len(form), self._rate)
        moved = scale[:, None] * (slope.T @ form + form @ slope + along) * scale
        size = np.max(np.abs(scale[:, None] * form * scale))
        return float(np.max(np.abs(moved)) / self._rate / size)

    def _constant(self, quantity: Callable) -> np.ndarray:
        """Which components do not change along the solution."""
        if self.problem.energy is None or not self.steady:
            return np.zeros(0, dtype=bool)
        same = []
        for y in self._states:
            step = _SHORT / self._rate * self._slope(y)
            (after, size), (before, _) = quantity(y + step), quantity(y - step)
            # Both ends lie off the solution by the square of the step.
            same.append(np.abs(after - before) <= 10.0 * _SHORT**2 * size)
        return np.all(same, axis=0)


def with_leaves(problem: Problem, values: Mapping[str, float]) -> Problem:
    """A problem with the arguments of some names set to a number each.

    Arguments:
        problem: whose `args` are a named tuple, a dict or the like; others stay as they are.
        values: by the name of a field.
    """

    def changed(path: Any, leaf: Any) -> Any:
        last = path[-1] if path else None
        name = str(getattr(last, "name", getattr(last, "key", "")))
        return np.full_like(leaf, values[name]) if name in values else leaf

    args = jax.tree_util.tree_map_with_path(changed, problem.args)
    return problem.changed(args=args, exact=None)


def scales(size: int, rate: float) -> np.ndarray:
    """Units of positions and velocities in which the fastest mode turns with radius 1.

    Arguments:
        size: of a flat state.
        rate: of the fastest mode.
    """
    return np.repeat([1.0, rate], size // 2)


def _cancel(terms: np.ndarray, size: float = 0.0) -> bool:
    """Whether terms sum up to zero, but for rounding."""
    return bool(abs(np.sum(terms)) <= _ROUNDING * (np.sum(np.abs(terms)) + size))


def _by_node(problem: Problem, half: np.ndarray) -> np.ndarray:
    """Positions or momenta as ``(nodes, dim)``."""
    return problem.quantity("position", np.stack([half, half])[None])[0]


def _cross(x: np.ndarray, p: np.ndarray) -> np.ndarray:
    """The angular momentum of each node; of none in one dimension."""
    if x.shape[-1] == 2:
        return (x[..., 0] * p[..., 1] - x[..., 1] * p[..., 0])[..., None]
    return np.cross(x, p) if x.shape[-1] == 3 else np.zeros((*x.shape[:-1], 0))


@functools.lru_cache(maxsize=64)
def _compiled_energy(energy: Any) -> tuple[Callable, Callable, Callable]:
    """Energy with momenta, its gradient, and the derivative of the momenta."""

    def momenta(t: Any, y: Any, args: Any) -> Any:
        return jax.grad(lambda v: energy(t, jnp.stack([y[0], v]), args))(y[1])

    def both(t: Any, y: Any, args: Any) -> Any:
        return energy(t, y, args), momenta(t, y, args)

    return (
        jax.jit(both),
        jax.jit(jax.grad(energy, argnums=1)),
        jax.jit(jax.jacfwd(momenta, argnums=1)),
    )


@functools.lru_cache(maxsize=64)
def _derivative(rhs: Rhs) -> Callable:
    """The derivative with respect to a flat state."""

    def slopes(t: Any, y: Any, args: Any) -> Any:
        return jax.jacfwd(lambda flat: rhs(t, flat.reshape(y.shape), args).ravel())(y.ravel())

    return jax.jit(slopes)
