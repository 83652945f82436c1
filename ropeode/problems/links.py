"""Nodes in a row, joined to their neighbours by rigid links or by springs."""

from __future__ import annotations

import itertools
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

# What rounding may leave of the difference between a rope's reach and a distance.
_ROUNDING = 1e-12


class LinearDamping(NamedTuple):
    """The part ``-rate * v`` of an acceleration.

    Fields:
        rate: damping per mass, in 1/time; broadcasts against the positions.
        coefficient: the damping coefficient itself, in mass/time. Only a stepper that
            (like the course assignment) uses it without the mass asks for it.

    Examples:
        >>> from ropeode import LinearDamping, Problem
        >>> fall = Problem.second_order(
        ...     acceleration=lambda t, x, v, drag: -9.81 - drag * v / 2.0,  # of a mass of 2
        ...     x0=[0.0], v0=[1.0], ts=[0.0, 1.0, 2.0], args=0.1,
        ...     damping=lambda drag: LinearDamping(rate=drag / 2.0, coefficient=drag),
        ... )
        >>> fall.mechanics.damping(fall.args)
        LinearDamping(rate=array(0.05), coefficient=array(0.1))
    """

    rate: Any
    coefficient: Any


class Links(NamedTuple):
    """Massless links between neighbours, rigid or springs, and what else moves the nodes.

    Positions are ``(dim, nodes)``; link i joins the nodes i and i + 1. Several ropes side by
    side are one array too, ``(dim, nodes * ropes)``: the first nodes of all ropes, then the
    second ones, and so on, with the links likewise. Vector units like that best. Neighbours
    then stand `apart` by the number of ropes.

    Fields:
        length: of each link, above zero, ``(links,)``.
        inverse_mass: of each node; zero where it is pinned, ``(nodes,)``.
        acceleration: of the nodes by everything but links and damping; zero where pinned;
            broadcasts against the positions.
        damping: the damping of the nodes.
        compliance: how much longer a unit of force makes each link, ``(links,)``: 1/stiffness of
            a spring, and 0 where a link is rigid. Steppers that keep lengths do not ask for it.

    Examples:
        >>> from ropeode import InextensibleRope, Rope
        >>> problem = InextensibleRope(num_nodes=4).problem(frames=3)
        >>> links = problem.mechanics.links(problem.args)
        >>> links.length.round(1), links.inverse_mass
        (array([133.3, 133.3, 133.3]), array([0., 1., 1., 1.]))
        >>> springs = Rope(num_nodes=4, stiffness=50).problem(frames=3)
        >>> springs.mechanics.links(springs.args).compliance
        array([0.02, 0.02, 0.02])
    """

    length: Any
    inverse_mass: Any
    acceleration: Any
    damping: LinearDamping
    compliance: Any = 0.0

    @property
    def apart(self) -> int:
        """How many places neighbours stand apart: 1 for one rope."""
        return self.inverse_mass.shape[-1] - self.length.shape[-1]


def constrained_acceleration(x: Any, v: Any, links: Links) -> Any:
    """The acceleration under which the links keep their lengths, ``(dim, nodes)``.

    With ``d`` the vector and ``w`` the relative velocity along a link, ``|d|`` is constant
    where ``d . d'' + |w|^2 = 0``; with the tensions as unknowns that is one tridiagonal system.

    Arguments:
        x: positions, ``(dim, nodes)``.
        v: velocities, ``(dim, nodes)``.
        links: the links.

    Source: index reduction of the equations of constrained mechanics; Hairer, Lubich, Wanner,
    Geometric Numerical Integration, section VII.1.4.
    """
    apart = links.apart
    d, w = along(x, apart), along(v, apart)
    applied = links.acceleration - links.damping.rate * v
    needed = dot(w, w) + dot(d, along(applied, apart))
    tension = tensions(d, d, needed, links.inverse_mass)
    return applied + impulses(d, tension, links.inverse_mass)


def taut_between(links: Links, x: np.ndarray) -> tuple[int, int] | None:
    """Two pinned nodes with free ones between them that the links leave no way to move.

    Arguments:
        links: of one rope, with numbers in them.
        x: positions, ``(dim, nodes)``.
    """
    pins = np.flatnonzero(np.asarray(links.inverse_mass) == 0)
    for pin, other in itertools.pairwise(pins):
        distance = np.linalg.norm(x[:, other] - x[:, pin])
        reach = np.sum(links.length[pin:other])
        if other - pin > 1 and distance >= reach * (1.0 - _ROUNDING):
            return int(pin), int(other)
    return None


def along(x: Any, apart: int) -> Any:
    """The differences of neighbours that stand so many places apart, ``(dim, links)``."""
    return x[:, apart:] - x[:, :-apart]


def dot(a: Any, b: Any) -> Any:
    """The scalar products of vectors, ``(links,)``."""
    return sum(p * q for p, q in zip(a, b, strict=True))


def impulses(d: Any, tension: Any, inverse_mass: Any) -> Any:
    """What pulls ``tension * d`` in each link do to the nodes' velocities, ``(dim, nodes)``."""
    apart = inverse_mass.shape[-1] - d.shape[-1]
    # Padded once at both ends: XLA would compute `tension` again for a second padded copy of it.
    pull = jnp.pad(tension * d, ((0, 0), (apart, apart)))
    return inverse_mass * (pull[:, apart:] - pull[:, :-apart])


def tensions(d: Any, pulled: Any, needed: Any, inverse_mass: Any) -> Any:
    """Tensions whose `impulses` along `pulled` shorten the links `d` as needed, ``(links,)``.

    Solves ``-d . along(impulses(pulled, tension)) = needed``, which is O(nodes) work. A link
    between two pinned nodes has no tension.

    Arguments:
        d: directions in which the links must shorten, ``(dim, links)``.
        pulled: directions in which the tensions pull, ``(dim, links)``.
        needed: for each link, ``(links,)``.
        inverse_mass: of each node, ``(nodes,)``.
    """
    apart = inverse_mass.shape[-1] - d.shape[-1]
    if not d.shape[-1]:
        return needed
    either = inverse_mass[:-apart] + inverse_mass[apart:]
    between = inverse_mass[apart:-apart]
    diagonal = jnp.where(either > 0, either * dot(d, pulled), 1.0)
    before = jnp.pad(-between * dot(d[:, apart:], pulled[:, :-apart]), (apart, 0))
    after = jnp.pad(-between * dot(d[:, :-apart], pulled[:, apart:]), (0, apart))
    needed = jnp.where(either > 0, needed, 0.0)
    # One system for each rope.
    rows = (row.reshape(-1, apart) for row in (before, diagonal, after, needed))
    return solve_tridiagonal(*rows).reshape(-1)


def solve_tridiagonal(lower: Any, diagonal: Any, upper: Any, right: Any) -> Any:
    """Solve ``lower[i] u[i-1] + diagonal[i] u[i] + upper[i] u[i+1] = right[i]``.

    By elimination without exchange of rows, which is stable for matrices that are positive
    definite or dominated by their diagonal. JAX's own `tridiagonal_solve` leaves the compiled
    program for LAPACK, one system after the other, which takes far longer than the arithmetic.

    Arguments:
        lower: below the diagonal, ``(rows, *systems)``; the first is not used.
        diagonal: ``(rows, *systems)``.
        upper: above the diagonal, ``(rows, *systems)``; the last is not used.
        right: right-hand sides, ``(rows, *systems)``; several for one matrix where an axis of
            the three others has length 1.

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
    start = jnp.zeros_like(diagonal[0]), nothing
    _, rows = jax.lax.scan(down, start, (lower, diagonal, upper, right))
    return jax.lax.scan(up, nothing, rows, reverse=True)[1]
