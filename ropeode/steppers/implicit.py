"""Implicit methods: the new state stands in an equation, which Newton's method solves."""

from __future__ import annotations

import dataclasses
import math
from typing import Any, ClassVar, NamedTuple

from ropeode.steppers.base import BuiltIn, ProblemClass, System
from ropeode.steppers.newton import Iterations, Newton, Stages, solve, unstarted


class Implicit(NamedTuple):
    """What implicit one-step methods carry: the state, and what became of Newton's method."""

    y: Any
    newton: Newton


@dataclasses.dataclass(frozen=True)
class _Implicit(BuiltIn):
    """What implicit methods have in common.

    Arguments:
        newton: when Newton's method ends. `converged`: when its corrections are so small that
            the next would be below rounding; where it does not converge the run ends,
            `unsolved`. `1`: after one iteration from the old state, a linearly implicit method,
            which is not symplectic.

    Class attributes:
        of_order: its order, of the equations solved.
        of_symplectic: whether it is symplectic, likewise.
    """

    family = "implicit"
    stages: ClassVar[int] = 1
    of_order: ClassVar[int]
    of_symplectic: ClassVar[bool] = False

    newton: Iterations = "converged"

    def order(self, problem_class: ProblemClass) -> int:
        """Its own, damped or not; one iteration leaves an error of order 3 in each step."""
        return self.of_order if self.newton == "converged" else min(self.of_order, 2)

    @property
    def symplectic(self) -> bool:  # type: ignore[override]
        """What Newton's method leaves after one iteration is not."""
        return self.of_symplectic and self.newton == "converged"

    def init(self, system: System, t: Any, y: Any, dt: Any) -> Any:
        """The initial state."""
        return Implicit(y, unstarted(system))

    def state(self, system: System, t: Any, carried: Any, dt: Any) -> Any:
        """The state alone."""
        return carried.y

    def solved(self, carried: Any) -> Any:
        """Whether Newton's method has always converged."""
        return carried.newton.solved

    def jacobian_evaluations(self, carried: Any) -> Any:
        """One in each iteration and stage."""
        return self.stages * carried.newton.iterations


@dataclasses.dataclass(frozen=True)
class _RungeKutta(_Implicit):
    """``Z_i = dt sum_j a_ij f(t + c_j dt, y + Z_j)``, ``y(t + dt) = y + sum_i d_i Z_i``.

    With the increments as unknowns, and ``d = b A^-1``, no stage is evaluated once more and
    rounding errors do not grow with the stiffness.

    Source: Hairer, Wanner, Solving ODEs II, eq. (IV.8.2).
    """

    a: ClassVar[tuple[tuple[float, ...], ...]]
    c: ClassVar[tuple[float, ...]]
    d: ClassVar[tuple[float, ...]]

    def step(self, system: System, t: Any, carried: Implicit, dt: Any) -> Implicit:
        """Solve for the increments of the stages."""
        y, newton = carried
        times = [t + c * dt for c in self.c]
        stages = Stages(times, [[dt * a for a in row] for row in self.a])
        z, newton = solve(system, stages, y, newton, self.newton)
        first, *others = (d * each for d, each in zip(self.d, z, strict=True))
        return Implicit(y + sum(others, first), newton)


@dataclasses.dataclass(frozen=True)
class ImplicitEuler(_RungeKutta):
    """``y(t + dt) = y + dt f(t + dt, y(t + dt))``.

    L-stable; it damps whatever moves. With ``newton=1`` it is the step of cloth simulation: the
    forces linearised at the old state, one linear system, and no test.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, eq. (I.1.6); with one
    iteration D. Baraff, A. Witkin, Large steps in cloth simulation (SIGGRAPH 1998).
    """

    name = "implicit-euler"
    source = "Hairer, Lubich, Wanner, Geometric Numerical Integration, (I.1.6)"
    of_order = 1
    a, c, d = ((1.0,),), (1.0,), (1.0,)


@dataclasses.dataclass(frozen=True)
class ImplicitMidpoint(_RungeKutta):
    """``y(t + dt) = y + dt f(t + dt/2, (y + y(t + dt))/2)``.

    A-stable, symmetric and symplectic, for any Hamiltonian: Gauss's method with one stage. It
    keeps every quadratic invariant.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, eq. (I.1.7); symplectic by
    theorem VI.3.5.
    """

    name = "implicit-midpoint"
    source = "Hairer, Lubich, Wanner, Geometric Numerical Integration, (I.1.7)"
    of_symplectic = True
    of_order = 2
    a, c, d = ((0.5,),), (0.5,), (2.0,)


_ROOT = math.sqrt(3.0)


@dataclasses.dataclass(frozen=True)
class Gauss4(_RungeKutta):
    """Gauss's method with two stages, at the nodes of Gauss's quadrature.

    A-stable, symmetric and symplectic, for any Hamiltonian, and of the highest order that two
    stages can have.

    Source: Hairer, Wanner, Solving ODEs II, table IV.5.1; Hairer, Lubich, Wanner, Geometric
    Numerical Integration, section II.1.3.
    """

    name = "gauss4"
    source = "Hairer, Wanner, Solving ODEs II, table IV.5.1"
    of_symplectic = True
    of_order = 4
    stages = 2
    a = ((1 / 4, 1 / 4 - _ROOT / 6), (1 / 4 + _ROOT / 6, 1 / 4))
    c = (1 / 2 - _ROOT / 6, 1 / 2 + _ROOT / 6)
    d = (-_ROOT, _ROOT)


@dataclasses.dataclass(frozen=True)
class Trapezium(_Implicit):
    """``y(t + dt) = y + dt/2 (f(t, y) + f(t + dt, y(t + dt)))``.

    A-stable and symmetric. It is conjugate to the implicit midpoint rule, which is symplectic,
    and itself is not.

    Source: Hairer, Norsett, Wanner, Solving ODEs I, eq. (III.1.8); conjugate to the midpoint rule
    by Hairer, Lubich, Wanner, Geometric Numerical Integration, section VI.8.
    """

    name = "trapezium"
    source = "Hairer, Norsett, Wanner, Solving ODEs I, (III.1.8)"
    of_order = 2

    def step(self, system: System, t: Any, carried: Implicit, dt: Any) -> Implicit:
        """The old slope is known; solve for the increment."""
        y, newton = carried
        stages = Stages([t + dt], [[dt / 2]], dt / 2 * system.rhs(t, y))
        (z,), newton = solve(system, stages, y, newton, self.newton)
        return Implicit(y + z, newton)


class TwoStates(NamedTuple):
    """What BDF2 carries: the state, the one before it, and what became of Newton's method."""

    y: Any
    before: Any
    newton: Newton


@dataclasses.dataclass(frozen=True)
class BDF2(_Implicit):
    """``y(t + dt) = 4/3 y - 1/3 y(t - dt) + 2/3 dt f(t + dt, y(t + dt))``.

    The start ``y(-dt) = y - dt f(0, y)`` makes the first step one of the theta method with
    ``theta = 2/3``: A-stable, and its error of order 2 occurs once.

    Source: C. F. Curtiss, J. O. Hirschfelder, Proc. Nat. Acad. Sci. 38 (1952); Hairer, Norsett,
    Wanner, Solving ODEs I, eq. (III.1.22'); A-stable by Hairer, Wanner, Solving ODEs II, section
    V.1.
    """

    name = "bdf2"
    source = "Hairer, Norsett, Wanner, Solving ODEs I, (III.1.22')"
    of_order = 2
    equal_frames = True

    def init(self, system: System, t: Any, y: Any, dt: Any) -> TwoStates:
        """The state, and one before it."""
        return TwoStates(y, y - dt * system.rhs(t, y), unstarted(system))

    def step(self, system: System, t: Any, carried: TwoStates, dt: Any) -> TwoStates:
        """Solve for the increment."""
        y, before, newton = carried
        stages = Stages([t + dt], [[2 / 3 * dt]], (y - before) / 3)
        (z,), newton = solve(system, stages, y, newton, self.newton)
        return TwoStates(y + z, y, newton)
