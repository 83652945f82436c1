"""The two Euler methods."""

from __future__ import annotations

import dataclasses
from typing import Any

from ropeode.steppers.base import BuiltIn, ProblemClass, System
from ropeode.steppers.phase import Phase


@dataclasses.dataclass(frozen=True)
class ExplicitEuler(BuiltIn):
    """``y(t + dt) = y + dt f(t, y)``.

    Source: L. Euler, Institutionum calculi integralis I (1768); Hairer, Lubich, Wanner,
    Geometric Numerical Integration, eq. (I.1.5).
    """

    name = "explicit-euler"
    family = "Runge-Kutta"
    source = "Hairer, Lubich, Wanner, Geometric Numerical Integration, (I.1.5)"

    def order(self, problem_class: ProblemClass) -> int:
        """Order 1."""
        return 1

    def step(self, system: System, t: Any, y: Any, dt: Any) -> Any:
        """One step of ``y + dt f(t, y)``."""
        return y + dt * system.rhs(t, y)


@dataclasses.dataclass(frozen=True)
class SemiImplicitEuler(BuiltIn):
    """``v += dt a(t, x, v)``, then ``x += dt v`` with the new velocity.

    Symplectic where the acceleration depends on the positions alone.
    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, eq. (I.1.9).
    """

    name = "semi-implicit-euler"
    family = "symplectic"
    needs = "second order"
    symplectic = True
    source = "Hairer, Lubich, Wanner, Geometric Numerical Integration, (I.1.9)"

    def order(self, problem_class: ProblemClass) -> int:
        """Order 1."""
        return 1

    def step(self, system: System, t: Any, y: Phase, dt: Any) -> Phase:
        """The velocity first, then the positions with it."""
        v = y.v + dt * system.acceleration(t, y.x, y.v)
        return Phase(y.x + dt * v, v)
