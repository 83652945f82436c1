"""Position-based dynamics: predict positions, project them link by link, read off velocities."""

from __future__ import annotations

import dataclasses
from typing import Any, Literal

import jax
import jax.numpy as jnp

from ropeode.problems.links import Links, along, dot, impulses
from ropeode.steppers.base import BuiltIn, ProblemClass, System
from ropeode.steppers.constraint import shares, sweep_to
from ropeode.steppers.phase import Phase

_SMALLEST = float(jnp.finfo(jnp.float64).tiny)

Sweep = Literal["gauss-seidel", "jacobi", "averaged"]


@dataclasses.dataclass(frozen=True)
class PositionBasedDynamics(BuiltIn):
    """``p = x + dt (v + dt g)/(1 + r dt)``; p projected; ``v = (p - x)/dt``, ``x = p``.

    A projection puts a link back to its length, with stiffness 1, as a sweep of
    `constraint-verlet` does. Damping with rate r = damping/mass acts per time, and implicitly: on
    the prediction, and as a mass that is larger by ``1 + r dt`` on the projections.

    It does not solve the rope with springs, whose stiffness it does not ask for. As dt shrinks it
    goes to the inextensible rope.

    Arguments:
        iterations: of the projection in each step, at least 1.
        sweep: `gauss-seidel`: one link after the other, from the first to the last; order 1.
            `jacobi`: all links from the same positions, and their moves added up; of order 1 with
            an even number of iterations, and unstable with 1, 3 and so on, whatever dt is.
            `averaged`: as jacobi, with the sum at a node divided by its number of links, which
            counts as a larger mass: it goes to another rope, whose inner nodes have twice the
            mass.

    Source: Müller, Heidelberger, Hennix, Ratcliff, Position Based Dynamics, J. Vis. Commun.
    Image R. 18 (2007), eq. (10) and (11); `averaged`: Macklin, Müller, Chentanez, Kim, Unified
    Particle Physics for Real-Time Applications, ACM Trans. Graph. 33 (2014).
    """

    name = "pbd"
    family = "graphics"
    needs = "nodes in a row"
    keeps_lengths = True
    source = "Müller et al., J. Vis. Commun. Image R. 18 (2007), (10), (11)"

    iterations: int = 1
    sweep: Sweep = "gauss-seidel"

    def order(self, problem_class: ProblemClass) -> int | None:
        """Order 1 on inextensible ropes, however many iterations; else another solution."""
        return _order_on_rigid_links(self.iterations, self.sweep) if problem_class.rigid else 0

    def step(self, system: System, t: Any, y: Phase, dt: Any) -> Phase:
        """Predict, project, and take the velocity from the move."""
        assert system.links is not None
        rigid = system.links._replace(compliance=0.0)
        return position_based_step(y, rigid, dt, self.iterations, self.sweep)


@dataclasses.dataclass(frozen=True)
class ExtendedPositionBasedDynamics(BuiltIn):
    """`pbd` whose projections give way: ``C + alpha/dt^2 lambda = 0``.

    C is how much too long a link is, lambda the sum of its moves in this step, and alpha its
    compliance: 1/stiffness of a spring, 0 of a rigid link. Already one iteration is consistent:
    as dt shrinks, alpha/dt^2 outgrows the masses in the formula, until each link is solved at
    once. Iterated to the end it is still not implicit Euler, since the first moves were along
    links that have turned since; but it is so near that it has the same leading error.

    Arguments:
        iterations: of the projection in each substep, at least 1.
        substeps: equal parts of a step, each with its own prediction and iterations, at least 1.
            So many times as many steps without substeps are the same.
        sweep: as for `pbd`. With springs `jacobi` is of order 1 too, and
            `averaged` goes to another rope here as well.

    Source: Macklin, Müller, Chentanez, XPBD (Motion in Games 2016), eq. (18) and algorithm 1;
    substeps: Macklin et al., Small Steps in Physics Simulation (Symposium on Computer Animation
    2019), algorithm 1.
    """

    name = "xpbd"
    family = "graphics"
    needs = "nodes in a row"
    source = "Macklin, Müller, Chentanez, XPBD, Motion in Games 2016, (18)"

    iterations: int = 1
    substeps: int = 1
    sweep: Sweep = "gauss-seidel"

    def order(self, problem_class: ProblemClass) -> int | None:
        """Order 1 on both ropes, unless moves are averaged."""
        if problem_class.rigid:
            return _order_on_rigid_links(self.iterations, self.sweep)
        return 0 if self.sweep == "averaged" else 1

    def step(self, system: System, t: Any, y: Phase, dt: Any) -> Phase:
        """As many steps as there are substeps."""
        links, h = system.links, dt / self.substeps
        assert links is not None

        def substep(_: Any, y: Phase) -> Phase:
            return position_based_step(y, links, h, self.iterations, self.sweep)

        return jax.lax.fori_loop(0, self.substeps, substep, y)


def _order_on_rigid_links(iterations: int, sweep: Sweep) -> int | None:
    """1 where the lengths settle, to those of the rope that is meant; None where that depends."""
    if sweep == "jacobi" and iterations % 2:
        # An eigenvalue below -1/3 of an odd power makes the lengths swing, ever wider. With more
        # iterations it may be above, on a short rope.
        return 0 if iterations == 1 else None
    return 0 if sweep == "averaged" else 1


def predicted(y: Phase, links: Links, dt: Any) -> tuple[Any, Links]:
    """The velocities without links, damped implicitly, and links with masses that are damped so.

    Where a pull f on a node of mass m changes the velocity by ``dt f/m`` without damping, with
    ``v = v_old + dt (f/m - r v)`` it does by ``dt f/(m (1 + r dt))``.
    """
    left = 1.0 / (1.0 + links.damping.rate * dt)
    v = left * (y.v + dt * links.acceleration)
    return v, links._replace(inverse_mass=left * links.inverse_mass)


def position_based_step(y: Phase, links: Links, dt: Any, iterations: int, sweep: Sweep) -> Phase:
    """Predict, project, and take the velocity from the move.

    Arguments:
        y: positions and velocities, ``(dim, nodes)``.
        links: with the compliance that is meant.
        dt: step size.
        iterations: of the projection.
        sweep: how each goes over the links.
    """
    v, damped = predicted(y, links, dt)
    p = projected(y.x + dt * v, damped, links.compliance / dt**2, iterations, sweep)
    return Phase(p, (p - y.x) / dt)


def projected(x: Any, links: Links, softness: Any, iterations: int, sweep: Sweep) -> Any:
    """Positions after iterations that take each link towards ``C = -softness * lambda``.

    Arguments:
        x: predicted positions, ``(dim, nodes)``.
        links: the links.
        softness: compliance over the square of the step size, ``(links,)``.
        iterations: how many.
        sweep: how each goes over the links.
    """
    if not links.length.shape[-1]:
        return x
    share = shares(links, softness)

    def iterate(_: Any, loop: tuple) -> tuple:
        # `pull` is -lambda. A link that pulls is meant to be longer by that much.
        x, pull = loop
        length = links.length + softness * pull
        if sweep == "gauss-seidel":
            x, was = sweep_to(length, x, links, softness)
            return x, pull + share * (was - length)
        d = along(x, links.apart)
        was = jnp.sqrt(dot(d, d) + _SMALLEST)
        more = share * (was - length)
        weight = links.inverse_mass / (links_of_node(links) if sweep == "averaged" else 1.0)
        return x + impulses(d, more / was, weight), pull + more

    return jax.lax.fori_loop(0, iterations, iterate, (x, jnp.zeros_like(links.length)))[0]


def links_of_node(links: Links) -> Any:
    """How many links each node has, ``(nodes,)``."""
    one = jnp.ones_like(links.length)
    return jnp.pad(one, (links.apart, 0)) + jnp.pad(one, (0, links.apart))
