"""Where a mechanical problem hangs still, and how fast it oscillates about that state."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from scipy.integrate import BDF
from scipy.linalg import null_space

from ropeode.precision import in_float64
from ropeode.problems import Acceleration, Problem, compiled, free_coordinates, require_problem
from ropeode.validation import bad_value

_EPS = float(np.finfo(np.float64).eps)
# Rounding of a sum of a few forces, in units of (stiffness times position times epsilon).
_ROUNDINGS = 64.0
# Fractions of the first residual, of the start's size, and of the time of the stiffest spring.
_NEAR_REST, _DISTURBANCE, _PATIENCE = 1e-6, 1e-4, 1e12
_MOST_STEPS, _MOST_CORRECTIONS = 5000, 50
# A rope hangs in the same way however long and with whichever stepper it is watched.
_EQUILIBRIA: dict[tuple, np.ndarray] = {}
_MOST_KEPT = 256


@in_float64
def hanging_equilibrium(problem: Problem) -> np.ndarray:
    """The state at rest in which nothing accelerates, reached from the initial positions.

    The positions first follow ``dx/ds = a(x, v=0)``, along which the potential energy
    falls (for a rope: it sinks through treacle), until little force is left. Newton's method
    then removes the rest, down to rounding. Where the initial state itself is an unstable
    equilibrium, as a rope that stands upright is, it starts from a small disturbance of it.

    Arguments:
        problem: a mechanical problem whose acceleration does not depend on time.

    Returns:
        The state, of the shape of ``problem.y0``; coordinates that are held are as there.

    Raises:
        InputError: the problem is not mechanical, depends on time, or has no stable
            equilibrium that can be reached so.

    Examples:
        >>> from ropeode import Rope, hanging_equilibrium
        >>> hanging_equilibrium(Rope(num_nodes=4).problem(frames=3))[0, 1].round(2)
        array([ 200.  ,   66.64,  -66.72, -200.06])
    """
    require_problem(problem)
    problem.require_equations()
    problem.require_mechanics("problem")
    key = (
        problem.mechanics,
        *(leaf.tobytes() for leaf in jax.tree.leaves((problem.y0, problem.args))),
    )
    y = _EQUILIBRIA.get(key)
    if y is None:
        if len(_EQUILIBRIA) >= _MOST_KEPT:
            _EQUILIBRIA.clear()
        y = _EQUILIBRIA[key] = _equilibrium(problem)
    return y.copy()


def _equilibrium(problem: Problem) -> np.ndarray:
    # Compiled: operation by operation JAX takes many times as long over it.
    acceleration = compiled(problem.require_mechanics("problem").acceleration)
    x, v = problem.y0
    first, *others = (
        np.asarray(acceleration(t, x, v, problem.args))
        for t in (problem.ts[0], np.mean(problem.ts), problem.ts[-1])
    )
    if any(not np.array_equal(first, other, equal_nan=True) for other in others):
        raise bad_value(
            "problem",
            problem.name,
            "one whose acceleration does not depend on time",
            "leave its driving force out",
        )
    at = _Still(problem)
    disturbance = _DISTURBANCE * problem.scale * np.random.default_rng(3).normal(size=len(at.start))
    for start in (at.start, at.start + disturbance):
        free = _corrected(at, _sunk(at, start))
        if free is not None and _is_stable(at, free):
            x = at.positions(free)
            return np.stack([x, np.zeros_like(x)])
    raise bad_value(
        "problem",
        problem.name,
        "one with a stable equilibrium that its initial positions sink to",
        "start it nearer to the state in which it hangs still",
    )


class NormalModes(NamedTuple):
    """The small undamped oscillations about an equilibrium, the slowest first.

    Fields:
        frequencies: radians per time unit, ``(modes,)``.
        weights: ``sum(weights[k] * (x - x_equilibrium))`` is how far a state is out in mode k:
            the largest component of its displacement in this mode alone. ``(modes, *positions)``.
    """

    frequencies: np.ndarray
    weights: np.ndarray


@in_float64
def normal_modes(problem: Problem, y: np.ndarray) -> NormalModes:
    """The small undamped oscillations about an equilibrium.

    Their frequencies are the square roots of the eigenvalues of ``-da/dx`` at zero velocity, over
    the motions that pins and constraints allow. As `a` is force over mass, these are the normal
    modes of unequal masses too (H. Goldstein, Classical Mechanics, 2nd ed., section 6-2). The
    coordinates in which they do not act on each other are the left eigenvectors of ``-da/dx``,
    scaled by the right ones.

    Arguments:
        problem: a mechanical problem.
        y: the equilibrium, as from `hanging_equilibrium`.

    Raises:
        InputError: the problem is not mechanical, or the state is not stable.
    """
    problem.require_mechanics("problem")
    at = _Still(problem)
    free = np.asarray(y)[0][at.free]
    if not _is_stable(at, free):
        raise bad_value(
            "y",
            y,
            "a stable equilibrium (this one has a mode that moves away from it)",
            "take it from hanging_equilibrium(problem)",
        )
    allowed = at.allowed(free)
    values, shapes = np.linalg.eig(allowed.T @ at.stiffness(free) @ allowed)
    order = np.argsort(np.real(values))
    values, shapes = np.real(values)[order], np.real(shapes)[:, order]
    largest = np.max(np.abs(allowed @ shapes), axis=0)
    weights = np.zeros((len(values), *at.free.shape))
    weights[:, at.free] = np.linalg.pinv(shapes / largest) @ allowed.T
    return NormalModes(np.sqrt(np.maximum(values, 0.0)), weights)


class _Still:
    """The problem at zero velocity, as a function of the free coordinates alone."""

    def __init__(self, problem: Problem):
        problem.require_equations()
        mechanics = problem.require_mechanics("problem")
        self._of, self._derivative = (
            compiled(make, mechanics.acceleration, problem.constraints)
            for make in (_still, _slopes)
        )
        self._problem = problem
        self._x0 = problem.y0[0]
        self.free = free_coordinates(problem)
        self.start = self._x0[self.free]
        if not self.free.any():
            allowed = "one in which something can move"
            raise bad_value("problem", problem.name, allowed, "leave a node free")

    def positions(self, free: np.ndarray) -> np.ndarray:
        x = self._x0.copy()
        x[self.free] = free
        return x

    def residual(self, free: np.ndarray) -> np.ndarray:
        """What vanishes at rest: the acceleration and, behind it, constraints if there are."""
        x = self.positions(free)
        acceleration, constraints = self._of(self._problem.ts[0], x, self._problem.args)
        return np.concatenate([np.asarray(acceleration)[self.free], np.ravel(constraints)])

    def derivative(self, free: np.ndarray) -> np.ndarray:
        """Of `residual`, one row for each of its entries."""
        x = self.positions(free)
        derivatives = self._derivative(self._problem.ts[0], x, self._problem.args)
        # JAX compiles each indexing of an array of its own.
        acceleration, constraints = map(np.asarray, derivatives)
        return np.concatenate([acceleration[self.free][:, self.free], constraints[..., self.free]])

    def acceleration(self, free: np.ndarray) -> np.ndarray:
        return self.residual(free)[: free.size]

    def stiffness(self, free: np.ndarray) -> np.ndarray:
        """``-da/dx``, square."""
        return -self.derivative(free)[: free.size]

    def allowed(self, free: np.ndarray) -> np.ndarray:
        """A basis of the motions that constraints allow, ``(coordinates, motions)``."""
        constraints = self.derivative(free)[free.size :]
        return null_space(constraints) if constraints.size else np.eye(free.size)

    def modes(self, free: np.ndarray) -> np.ndarray:
        """The eigenvalues of the stiffness, over the motions that constraints allow."""
        allowed = self.allowed(free)
        return np.real(np.linalg.eigvals(allowed.T @ self.stiffness(free) @ allowed))


def _still(acceleration: Acceleration, constraints: Any) -> Callable:
    """The acceleration at rest, and by how much constraints on positions are missed."""

    def still(t: Any, x: Any, args: Any) -> Any:
        v = jnp.zeros_like(x)
        off = {} if constraints is None else constraints(t, jnp.stack([x, v]), args)
        return acceleration(t, x, v, args), off.get("position", jnp.zeros(0))

    return still


def _slopes(acceleration: Acceleration, constraints: Any) -> Callable:
    return jax.jacfwd(_still(acceleration, constraints), argnums=1)


def _sunk(at: _Still, start: np.ndarray) -> np.ndarray:
    """Where ``dx/ds = a(x)`` leads to, roughly."""
    first = np.linalg.norm(at.acceleration(start))
    stiffest = np.linalg.norm(at.stiffness(start), 2)
    if first == 0.0 or stiffest == 0.0:
        return start

    with np.errstate(all="ignore"):
        solver = BDF(
            lambda s, free: at.acceleration(free),
            0.0,
            start,
            _PATIENCE / stiffest,
            jac=lambda s, free: -at.stiffness(free),
            rtol=1e-4,
            atol=1e-6 * float(np.max(np.abs(start), initial=1e-300)),
        )
        for _ in range(_MOST_STEPS):
            solver.step()
            left = np.linalg.norm(at.acceleration(solver.y))
            if solver.status != "running" or left <= _NEAR_REST * first:
                break
    return solver.y


def _corrected(at: _Still, free: np.ndarray) -> np.ndarray | None:
    """The zero of the residual near `free`, by Newton's method; None if there is none."""
    best, smallest = free, np.inf
    for _ in range(_MOST_CORRECTIONS):
        residual = at.residual(free)
        size = float(np.max(np.abs(residual)))
        if not size < smallest:
            break
        best, smallest = free, size
        # Least squares: a rope without gravity may turn about its pin, which is no fault.
        free = free - np.linalg.lstsq(at.derivative(free), residual, rcond=None)[0]
    # Forces that cancel at rest do not cancel at the start; positions are only good to a
    # rounding.
    terms = np.max(np.abs(at.derivative(best)) @ np.abs(best))
    terms += np.sum(np.abs(at.residual(at.start)))
    return best if smallest <= _ROUNDINGS * _EPS * terms else None


def _is_stable(at: _Still, free: np.ndarray) -> bool:
    rounding = _ROUNDINGS * _EPS * np.linalg.norm(at.stiffness(free))
    return bool(np.all(at.modes(free) >= -rounding))
