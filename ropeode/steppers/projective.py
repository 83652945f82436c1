"""Projective dynamics: implicit Euler by steps that are each easy, one local and one global."""

from __future__ import annotations

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp

from ropeode.problems.links import Links, along, dot, impulses, solve_tridiagonal
from ropeode.steppers.base import BuiltIn, ProblemClass, System
from ropeode.steppers.phase import Phase
from ropeode.steppers.position_based import predicted

_SMALLEST = float(jnp.finfo(jnp.float64).tiny)


@dataclasses.dataclass(frozen=True)
class ProjectiveDynamics(BuiltIn):
    """``(M/dt^2 + K) x = M/dt^2 p + J^T k l n``, in turn with ``n = d/|d|`` of each spring.

    Implicit Euler as the smallest value of a function: that of the inertia,
    ``|x - p|^2_M/(2 dt^2)`` with the prediction p of `pbd`, and of the springs,
    ``k |d - l n|^2/2`` with their own direction n each. The local step finds the directions, the
    global one the positions, by one tridiagonal system with a constant matrix, ``K = J^T k J``.

    Damping acts per time and implicitly, as a mass that is larger by ``1 + r dt``.

    Already one iteration is consistent: from the prediction, the directions are wrong by
    ``dt^2``.

    Arguments:
        iterations: local and global steps in each step, at least 1; the first starts from the
            prediction.

    Source: Liu, Bargteil, O'Brien, Kavan, Fast Simulation of Mass-Spring Systems, ACM Trans.
    Graph. 32 (2013); as projective dynamics: Bouaziz, Martin, Liu, Kavan, Pauly, ACM Trans. Graph.
    33 (2014).
    """

    name = "projective-dynamics"
    family = "graphics"
    needs = "springs in a row"
    source = "Liu et al., ACM Trans. Graph. 32 (2013)"

    iterations: int = 1

    def order(self, problem_class: ProblemClass) -> int:
        """Order 1, however many iterations."""
        return 1

    def step(self, system: System, t: Any, y: Phase, dt: Any) -> Phase:
        """Predict, iterate, and take the velocity from the move."""
        assert system.links is not None
        v, links = predicted(y, system.links, dt)
        p = y.x + dt * v
        ahead = along(p, links.apart)
        stiffness = 1.0 / links.compliance

        def iterate(_: Any, moved: Any) -> Any:
            d = along(p + moved, links.apart)
            n = d / jnp.sqrt(dot(d, d) + _SMALLEST)
            return solve(impulses(ahead - links.length * n, dt**2 * stiffness, links.inverse_mass))

        solve = _global_step(links, dt**2 * stiffness)
        moved = jax.lax.fori_loop(0, self.iterations, iterate, jnp.zeros_like(p))
        return Phase(p + moved, v + moved / dt)


def _global_step(links: Links, stiffness: Any) -> Any:
    """What solves ``(1 + W K) moved = right`` for right-hand sides ``(dim, nodes)``.

    W are the inverse masses, and K takes positions to the forces of springs without lengths.

    Arguments:
        links: the springs.
        stiffness: of each, times the square of the step size, ``(links,)``.
    """
    apart = links.apart
    before, after = jnp.pad(stiffness, (apart, 0)), jnp.pad(stiffness, (0, apart))
    weight = links.inverse_mass
    # One matrix for each rope, and one system for each component.
    lower, diagonal, upper = (
        row.reshape(-1, 1, apart)
        for row in (-weight * before, 1.0 + weight * (before + after), -weight * after)
    )

    def solve(right: Any) -> Any:
        by_node = jnp.moveaxis(right.reshape(len(right), -1, apart), 1, 0)
        return jnp.moveaxis(solve_tridiagonal(lower, diagonal, upper, by_node), 0, 1).reshape(
            right.shape
        )

    return solve
