"""The Verlet family."""

from __future__ import annotations

import dataclasses
from typing import Any, Literal, NamedTuple

from ropeode.problems.links import LinearDamping
from ropeode.steppers.base import BuiltIn, ProblemClass, System
from ropeode.steppers.phase import Phase


class TwoPositions(NamedTuple):
    """What the position form carries: ``x(t)`` and ``x(t - dt)``."""

    now: Any
    before: Any


Damping = Literal["centered", "lagged", "per-step"]


def advance(choice: Damping, damping: LinearDamping, moved: Any, a: Any, dt: Any) -> Any:
    """How far the positions move in a step, from how far they moved in the last one.

    The small terms are added up before they meet x: each sum with x itself is rounded to a
    unit of x, and in much the same way at every step, so that it does not average out.

    Arguments:
        choice: how the damping enters, as `StormerVerlet` explains.
        damping: rate and coefficient.
        moved: ``x(t) - x(t - dt)``.
        a: the acceleration without damping.
        dt: step size.
    """
    rate, coefficient = damping
    if choice == "centered":
        half = rate * dt / 2
        return ((1 - half) * moved + dt**2 * a) / (1 + half)
    if choice == "lagged":
        return (1 - rate * dt) * moved + dt**2 * a
    return (1 - coefficient) * moved + dt**2 * a


@dataclasses.dataclass(frozen=True)
class StormerVerlet(BuiltIn):
    """The position form, ``x(t + dt) = 2 x(t) - x(t - dt) + dt^2 a(t, x)``.

    It is a two-step method: both its start and its damping have to be chosen, and the usual
    shortcuts cost an order or more.

    Arguments:
        start: where ``x(-dt)`` comes from. `taylor`: ``x - dt v + dt^2/2 a``, which keeps
            order 2. `rest`: ``x(-dt) = x(0)``, as in the course assignment: order 1 from
            rest, and another solution where the initial velocity is not zero.
        damping: how ``-r v`` enters, with r = damping/mass. `centered`: with
            ``v = (x(t + dt) - x(t - dt))/(2 dt)``, solved for ``x(t + dt)``; order 2.
            `lagged`: with ``v = (x(t) - x(t - dt))/dt``, the factor ``1 - r dt``; order 1.
            `per-step`: the factor ``1 - damping`` on each step, whatever dt is, as in the
            assignment: the damping rate is about damping/dt, and there is no limit that
            solves the ODE.

    Velocities of samples are the central differences ``(x(t + dt) - x(t - dt))/(2 dt)``.

    Source: L. Verlet, Phys. Rev. 159 (1967), eq. (4); Hairer, Lubich, Wanner, Geometric
    Numerical Integration, eq. (I.1.15).
    """

    name = "stormer-verlet"
    family = "symplectic"
    needs = "second order, linear damping"
    symplectic = True
    source = "Verlet, Phys. Rev. 159 (1967), (4)"
    equal_frames = True

    start: Literal["taylor", "rest"] = "taylor"
    damping: Damping = "centered"

    def order(self, problem_class: ProblemClass) -> int:
        """Order 2, less what the start and the damping cost."""
        if self.start == "rest" and not problem_class.at_rest:
            return 0
        if self.damping == "per-step" and problem_class.damped:
            return 0
        lagged = self.damping == "lagged" and problem_class.damped
        return 1 if self.start == "rest" or lagged else 2

    def init(self, system: System, t: Any, y: Phase, dt: Any) -> TwoPositions:
        """``x(0)`` and ``x(-dt)``."""
        if self.start == "rest":
            return TwoPositions(y.x, y.x)
        a = system.acceleration(t, y.x, y.v)
        return TwoPositions(y.x, y.x - dt * y.v + dt**2 / 2 * a)

    def step(self, system: System, t: Any, x: TwoPositions, dt: Any) -> TwoPositions:
        """One step of the position form."""
        assert system.damping is not None
        a = system.undamped_acceleration(t, x.now)
        moved = advance(self.damping, system.damping, x.now - x.before, a, dt)
        return TwoPositions(x.now + moved, x.now)

    def state(self, system: System, t: Any, x: TwoPositions, dt: Any) -> Phase:
        """Positions, and velocities by central differences."""
        after = self.step(system, t, x, dt).now
        return Phase(x.now, (after - x.before) / (2 * dt))


class Kicked(NamedTuple):
    """What velocity Verlet carries: a state and its undamped acceleration."""

    x: Any
    v: Any
    a: Any


@dataclasses.dataclass(frozen=True)
class VelocityVerlet(BuiltIn):
    """Half a kick, a drift, half a kick; one evaluation of the acceleration per step.

    With damping rate r the first half kick takes the damping from the old velocity and the
    second from the new one (solved for it), so that the step stays symmetric and of order 2.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, eq. (I.1.17); the damped
    form is the symmetric one of Brunger, Brooks, Karplus, Chem. Phys. Lett. 105 (1984),
    without its random force.
    """

    name = "velocity-verlet"
    family = "symplectic"
    needs = "second order, linear damping"
    symplectic = True
    source = "Hairer, Lubich, Wanner, Geometric Numerical Integration, (I.1.17)"

    def order(self, problem_class: ProblemClass) -> int:
        """Order 2, damped or not."""
        return 2

    def init(self, system: System, t: Any, y: Phase, dt: Any) -> Kicked:
        """The initial state with its acceleration."""
        return Kicked(y.x, y.v, system.undamped_acceleration(t, y.x))

    def step(self, system: System, t: Any, y: Kicked, dt: Any) -> Kicked:
        """Kick, drift, kick."""
        assert system.damping is not None
        half = system.damping.rate * dt / 2
        v_middle = (1 - half) * y.v + dt / 2 * y.a
        x = y.x + dt * v_middle
        a = system.undamped_acceleration(t + dt, x)
        return Kicked(x, (v_middle + dt / 2 * a) / (1 + half), a)

    def state(self, system: System, t: Any, y: Kicked, dt: Any) -> Phase:
        """The state without its acceleration."""
        return Phase(y.x, y.v)
