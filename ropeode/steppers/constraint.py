"""Steppers that keep the distances of neighbours: a rope with rigid links."""

from __future__ import annotations

import dataclasses
from typing import Any, Literal, NamedTuple

import jax
import jax.numpy as jnp

from ropeode.problems.links import (
    Links,
    along,
    constrained_acceleration,
    dot,
    impulses,
    tensions,
)
from ropeode.steppers.base import BuiltIn, ProblemClass, System
from ropeode.steppers.phase import Phase
from ropeode.steppers.reductions import largest
from ropeode.steppers.verlet import Damping, TwoPositions, advance

# Newton's method doubles the digits each time; where this many iterations do not suffice, the
# step was too long for the links to be kept.
_MOST_ITERATIONS = 30
_SMALLEST = float(jnp.finfo(jnp.float64).tiny)


@dataclasses.dataclass(frozen=True)
class ConstraintVerlet(BuiltIn):
    """Links put back to their lengths one after the other, then a Verlet step without them.

    The course assignment's constraint rope. Each sweep goes from the first link to the last
    and moves the two nodes of each link along it, in proportion to their inverse masses: half
    each where these are equal, the free one all the way where the other is pinned. Putting
    one link right spoils the one before; the next step's sweep goes on from there.

    It does not solve the rope with springs. As dt shrinks it goes to the inextensible rope.

    Arguments:
        sweeps: over the links in each step, at least 1.
        start: where ``x(-dt)`` comes from. `taylor`: ``x - dt v + dt^2/2 a`` with the
            acceleration of the inextensible rope. `rest`: ``x(-dt) = x(0)``, as in the
            assignment; another solution where the initial velocity is not zero.
        damping: as for `stormer-verlet`; `per-step` is the assignment's.

    Velocities of samples are the central differences of positions after the sweeps.

    Source: T. Jakobsen, Advanced Character Physics (Game Developers Conference 2001), without
    number; as position based dynamics: Müller, Heidelberger, Hennix, Ratcliff, J. Vis. Commun.
    Image R. 18 (2007).
    """

    name = "constraint-verlet"
    family = "rigid links"
    needs = "nodes in a row"
    keeps_lengths = True
    source = "Jakobsen, Advanced Character Physics, GDC 2001"
    equal_frames = True

    sweeps: int = 1
    start: Literal["taylor", "rest"] = "taylor"
    damping: Damping = "centered"

    def order(self, problem_class: ProblemClass) -> int:
        """Order 1 on inextensible ropes, however many sweeps; else another solution."""
        if not problem_class.rigid or (self.start == "rest" and not problem_class.at_rest):
            return 0
        return 0 if self.damping == "per-step" and problem_class.damped else 1

    def init(self, system: System, t: Any, y: Phase, dt: Any) -> TwoPositions:
        """``x(0)`` and ``x(-dt)``."""
        assert system.links is not None
        if self.start == "rest":
            return TwoPositions(y.x, y.x)
        a = constrained_acceleration(y.x, y.v, system.links)
        return TwoPositions(y.x, y.x - dt * y.v + dt**2 / 2 * a)

    def step(self, system: System, t: Any, x: TwoPositions, dt: Any) -> TwoPositions:
        """Sweep, then move; what is carried as the last position has been swept."""
        assert system.links is not None
        links = system.links
        swept = jax.lax.fori_loop(0, self.sweeps, lambda _, x: sweep(x, links), x.now)
        moved = advance(self.damping, links.damping, swept - x.before, links.acceleration, dt)
        return TwoPositions(swept + moved, swept)

    def state(self, system: System, t: Any, x: TwoPositions, dt: Any) -> Phase:
        """Positions as they are shown, before the sweep, and velocities."""
        after = self.step(system, t, self.step(system, t, x, dt), dt).before
        return Phase(x.now, (after - x.before) / (2 * dt))


def sweep(x: Any, links: Links) -> Any:
    """Each link put back to its length, from the first to the last; ``(dim, nodes)``."""
    return sweep_to(links.length, x, links)[0]


def sweep_to(length: Any, x: Any, links: Links, softness: Any = 0.0) -> tuple[Any, Any]:
    """Each link brought to a length, from the first to the last.

    A link of length zero, which has no direction, is left as it is.

    Arguments:
        length: that each link is given, ``(links,)``.
        x: positions, ``(dim, nodes)``.
        links: the links.
        softness: of each link, ``(links,)``: it counts as one more inverse mass, beside those of
            the link's two nodes, and so takes its part of the move from them.

    Returns:
        The positions, and how long each link was when its turn came, ``(links,)``.
    """
    apart = links.apart
    if not links.length.shape[-1]:
        return x, links.length
    share = shares(links, softness)
    first, second = links.inverse_mass[:-apart] * share, links.inverse_mass[apart:] * share

    def by_link(row: Any) -> Any:
        return row.reshape(*row.shape[:-1], -1, apart)

    def one(a: Any, link: tuple) -> tuple:
        # What the link before has made of its second node is this link's first.
        b, length, first, second = link
        d = b - a
        # Something tiny is added, so that a link of length zero divides by no zero.
        was = jnp.sqrt(dot(d, d) + _SMALLEST)
        excess = (1.0 - length / was) * d
        return b - second * excess, (a + first * excess, was)

    others = jnp.moveaxis(by_link(x)[:, 1:], 1, 0)
    rows = (others, by_link(length), by_link(first), by_link(second))
    # Three links in one pass of the loop: a fifth faster.
    last, (moved, was) = jax.lax.scan(one, x[:, :apart], rows, unroll=3)
    moved = jnp.moveaxis(jnp.concatenate([moved, last[None]]), 0, 1).reshape(x.shape)
    return moved, was.reshape(-1)


def shares(links: Links, softness: Any) -> Any:
    """1 over the inverse masses of each link's nodes and its softness; 0 between pins."""
    apart = links.apart
    either = links.inverse_mass[:-apart] + links.inverse_mass[apart:]
    return jnp.where(either > 0, 1.0 / jnp.where(either > 0, either + softness, 1.0), 0.0)


class Kept(NamedTuple):
    """What `Rattle` carries: a state, and whether the lengths were kept so far, ``(ropes,)``."""

    y: Phase
    solved: Any


@dataclasses.dataclass(frozen=True)
class Rattle(BuiltIn):
    """Velocity Verlet with links: lengths exact at each step, and no link being stretched.

    The first half kick includes pulls along the links as they are before the step, such that
    the lengths are right after it; the second half kick includes pulls along the links as
    they are then, such that no length is changing. Damping enters as in `velocity-verlet`.

    The lengths are kept by Newton's method. Where a step is too long for it to converge, the run
    ends, `unsolved`.

    Source: H. C. Andersen, J. Comput. Phys. 52 (1983); Hairer, Lubich, Wanner, Geometric
    Numerical Integration, eq. (VII.1.26).
    """

    name = "rattle"
    family = "rigid links"
    needs = "nodes in a row"
    keeps_lengths = True
    symplectic = True
    source = "Andersen, J. Comput. Phys. 52 (1983)"

    def order(self, problem_class: ProblemClass) -> int:
        """Order 2 on inextensible ropes; else another solution."""
        return 2 if problem_class.rigid else 0

    def init(self, system: System, t: Any, y: Phase, dt: Any) -> Kept:
        """The initial state."""
        assert system.links is not None
        return Kept(y, jnp.ones(system.links.apart, bool))

    def step(self, system: System, t: Any, carried: Kept, dt: Any) -> Kept:
        """Kick, drift with the lengths kept, kick with the rates kept."""
        assert system.links is not None
        y, links = carried.y, system.links
        half = links.damping.rate * dt / 2
        kick = dt / 2 * links.acceleration
        v_middle, kept = with_lengths_kept(y.x, (1 - half) * y.v + kick, links, dt)
        x = y.x + dt * v_middle
        v = with_rates_kept(x, (v_middle + kick) / (1 + half), half, links)
        return Kept(Phase(x, v), carried.solved & kept)

    def state(self, system: System, t: Any, carried: Kept, dt: Any) -> Phase:
        """The state alone."""
        return carried.y

    def solved(self, carried: Kept) -> Any:
        """Whether the lengths were always kept."""
        return carried.solved


def with_lengths_kept(x: Any, v: Any, links: Links, dt: Any) -> tuple[Any, Any]:
    """Velocities with pulls along the links added so that ``x + dt v`` has the right lengths.

    By Newton's method for the lengths' squares. Of ropes side by side each makes as many
    iterations as it makes alone, so that its result does not depend on the others.

    Returns:
        The velocities, not-a-number where the lengths are not kept; and whether they are, or the
        run had diverged before, ``(ropes,)``.
    """
    apart = links.apart
    d = along(x, apart)
    if not d.shape[1]:
        return v, True

    def by_rope(row: Any) -> Any:
        return row.reshape(-1, apart)

    length = by_rope(links.length)
    rounding = 1.0 + largest(by_rope(jnp.abs(x))) / -largest(-length)
    close = 16.0 * jnp.finfo(jnp.float64).eps * rounding * length**2

    def fault(v: Any) -> Any:
        ahead = along(x + dt * v, apart)
        return dot(ahead, ahead) - links.length**2

    def corrected(v: Any) -> Any:
        ahead = along(x + dt * v, apart)
        tension = tensions(ahead, d, fault(v) / (2.0 * dt), links.inverse_mass)
        return v + impulses(d, tension, links.inverse_mass)

    def where(of_ropes: Any, v: Any, other: Any) -> Any:
        return jnp.where(jnp.tile(of_ropes, x.shape[1] // apart), v, other)

    def too_far(wrong: Any) -> Any:
        return jnp.any(jnp.abs(by_rope(wrong)) > close, axis=0)

    def iterate(loop: tuple) -> tuple:
        count, v, wrong = loop
        # A rope alone is in the loop only as long as it is too far.
        v = corrected(v) if apart == 1 else where(too_far(wrong), corrected(v), v)
        return count + 1, v, fault(v)

    def going_on(loop: tuple) -> Any:
        count, _, wrong = loop
        return (count < _MOST_ITERATIONS) & jnp.any(too_far(wrong))

    wrong = fault(v)
    finite = jnp.all(jnp.isfinite(by_rope(wrong)), axis=0)
    _, v, _ = jax.lax.while_loop(going_on, iterate, (0, v, wrong))
    # One more than needed: it costs little, and takes what the last one left down to rounding.
    v = corrected(v)
    kept = jnp.all(jnp.abs(by_rope(fault(v))) <= close, axis=0)
    return where(kept, v, jnp.nan), kept | ~finite


def with_rates_kept(x: Any, v: Any, half: Any, links: Links) -> Any:
    """Velocities with pulls along the links added so that no length is changing."""
    d = along(x, links.apart)
    weight = links.inverse_mass / (1 + half)
    return v + impulses(d, tensions(d, d, dot(d, along(v, links.apart)), weight), weight)
