"""A stepper that carries something from step to step: Verlet's position form, of order 2."""

from typing import Any, NamedTuple

from ropeode import Phase, Stepper


class TwoPositions(NamedTuple):
    """What is carried: any named tuple of arrays will do."""

    x: Any
    last_x: Any


class PositionVerlet(Stepper):
    """x(t + dt) = 2 x(t) - x(t - dt) + dt^2 a(t, x)."""

    needs = "second order"
    equal_frames = True  # dt must not change on the way

    def init(self, system, t, y, dt):
        """What the first step starts from; y.x and y.v are arrays (nodes, dim)."""
        a = system.acceleration(t, y.x, y.v)
        return TwoPositions(y.x, y.x - dt * y.v + dt**2 / 2 * a)

    def step(self, system, t, carried, dt):
        """From time t to t + dt."""
        v = (carried.x - carried.last_x) / dt
        x = 2 * carried.x - carried.last_x + dt**2 * system.acceleration(t, carried.x, v)
        return TwoPositions(x, carried.x)

    def state(self, system, t, carried, dt):
        """The state at time t, where a sample is due."""
        after = self.step(system, t, carried, dt).x
        return Phase(carried.x, (after - carried.last_x) / (2 * dt))

    def order(self, problem_class):
        """What is claimed: with damping, the velocity is that of half a step ago."""
        return 1 if problem_class.damped else 2
