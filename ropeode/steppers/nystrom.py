"""Runge-Kutta-Nystrom methods, which step positions and velocities of second-order problems."""

from __future__ import annotations

import dataclasses
from typing import Any

from ropeode.steppers.base import BuiltIn, ProblemClass, System
from ropeode.steppers.phase import Phase


@dataclasses.dataclass(frozen=True)
class Nystrom4(BuiltIn):
    """Nystrom's method of order 4, with three evaluations of the forces.

    The acceleration is ``g(t, x) - r v``, with damping rate r. The forces g are taken at x, at
    ``x + dt/2 v + dt^2/8 k1``, and at ``x + dt v + dt^2/2 k3``; ``x += dt v + dt^2/6 (k1 + k2 +
    k3)`` and ``v += dt/6 (k1 + 2 k2 + 2 k3 + k4)``.

    The accelerations k2 and k3 have the same forces, and differ by their damping alone, which is
    that of ``v + dt/2 k1`` and of ``v + dt/2 k2``. So the order holds with damping too. Without
    it, k2 = k3, and this is the textbooks' method for forces of time and positions. One that
    took the damping of k2 for both would have order 2.

    Source: E. J. Nystrom, Acta Soc. Sci. Fenn. 50 (1925); Hairer, Norsett, Wanner, Solving
    Ordinary Differential Equations I, section II.14.
    """

    name = "rkn4"
    family = "Runge-Kutta"
    needs = "second order, linear damping"
    source = "Hairer, Norsett, Wanner, Solving ODEs I, section II.14"

    def order(self, problem_class: ProblemClass) -> int:
        """Order 4, damped or not."""
        return 4

    def step(self, system: System, t: Any, y: Phase, dt: Any) -> Phase:
        """Three forces, four accelerations."""
        assert system.damping is not None
        rate, force = system.damping.rate, system.undamped_acceleration
        x, v = y.x, y.v
        k1 = force(t, x) - rate * v
        middle = force(t + dt / 2, x + dt / 2 * v + dt**2 / 8 * k1)
        k2 = middle - rate * (v + dt / 2 * k1)
        k3 = middle - rate * (v + dt / 2 * k2)
        k4 = force(t + dt, x + dt * v + dt**2 / 2 * k3) - rate * (v + dt * k3)
        return Phase(
            x + (dt * v + dt**2 / 6 * (k1 + k2 + k3)), v + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        )
