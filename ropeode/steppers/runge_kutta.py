"""Runge-Kutta methods."""

from __future__ import annotations

import dataclasses
from typing import Any

from ropeode.steppers.base import BuiltIn, ProblemClass, System


@dataclasses.dataclass(frozen=True)
class RungeKutta4(BuiltIn):
    """The classical method of order 4.

    Source: W. Kutta, Z. Math. Phys. 46 (1901); Hairer, Norsett, Wanner, Solving Ordinary
    Differential Equations I, table II.1.2 (left).
    """

    name = "rk4"
    source = "Hairer, Norsett, Wanner, Solving ODEs I, table II.1.2"

    def order(self, problem_class: ProblemClass) -> int:
        """Order 4."""
        return 4

    def step(self, system: System, t: Any, y: Any, dt: Any) -> Any:
        """Four slopes, weighted 1 : 2 : 2 : 1."""
        f = system.rhs
        k1 = f(t, y)
        k2 = f(t + dt / 2, y + dt / 2 * k1)
        k3 = f(t + dt / 2, y + dt / 2 * k2)
        k4 = f(t + dt, y + dt * k3)
        return y + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
