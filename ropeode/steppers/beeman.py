"""Beeman's method, a multistep method of molecular dynamics."""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple

from ropeode.steppers.base import BuiltIn, ProblemClass, System
from ropeode.steppers.phase import Phase


class TwoAccelerations(NamedTuple):
    """What Beeman's method carries: a state, its acceleration, and that of one step before."""

    x: Any
    v: Any
    a: Any
    a_before: Any


@dataclasses.dataclass(frozen=True)
class Beeman(BuiltIn):
    """``x += dt v + dt^2/6 (4 a - a_before)``, ``v += dt/6 (2 a_new + 5 a - a_before)``.

    Without damping its positions are those of Verlet's method; its velocities have a smaller
    error than central differences, and the same order.

    Forces that depend on velocities are handed the prediction ``v + dt/2 (3 a - a_before)``. Its
    error is of order dt^3, and reaches the state as dt^4 in each step, so that damping, linear or
    not, costs no order. There is one evaluation for a step: the acceleration at the prediction is
    kept.

    The acceleration before the start is that at ``x - dt v + dt^2/2 a``, ``v - dt a``.

    Source: P. Schofield, Comput. Phys. Commun. 5 (1973); D. Beeman, J. Comput. Phys. 20 (1976);
    both without number.
    """

    name = "beeman"
    family = "multistep"
    needs = "second order"
    source = "Beeman, J. Comput. Phys. 20 (1976)"
    equal_frames = True

    def order(self, problem_class: ProblemClass) -> int:
        """Order 2, damped or not."""
        return 2

    def init(self, system: System, t: Any, y: Phase, dt: Any) -> TwoAccelerations:
        """The initial state with the accelerations there and one step before."""
        a = system.acceleration(t, y.x, y.v)
        x_before, v_before = y.x - dt * y.v + dt**2 / 2 * a, y.v - dt * a
        return TwoAccelerations(y.x, y.v, a, system.acceleration(t - dt, x_before, v_before))

    def step(self, system: System, t: Any, y: TwoAccelerations, dt: Any) -> TwoAccelerations:
        """Positions, predicted velocities, acceleration, velocities."""
        x = y.x + (dt * y.v + dt**2 / 6 * (4 * y.a - y.a_before))
        predicted = y.v + dt / 2 * (3 * y.a - y.a_before)
        a = system.acceleration(t + dt, x, predicted)
        return TwoAccelerations(x, y.v + dt / 6 * (2 * a + 5 * y.a - y.a_before), a, y.a)

    def state(self, system: System, t: Any, y: TwoAccelerations, dt: Any) -> Phase:
        """The state without its accelerations."""
        return Phase(y.x, y.v)
