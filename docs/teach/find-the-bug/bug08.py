"""Verlet in its position form: it carries the last position.

ropeode check bug08.py
"""

from typing import Any, NamedTuple

from ropeode import Phase, Stepper


class Positions(NamedTuple):
    """What is carried from step to step."""

    now: Any
    last: Any


class Verlet(Stepper):
    """x + (x - last) + dt^2 a, with centred damping."""

    name = "my-verlet"
    needs = "second order, linear damping"
    equal_frames = True

    def order(self, problem_class):
        """2, on all problems."""
        return 2

    def init(self, system, t, y, dt):
        """Positions at t and at t - dt."""
        return Positions(y.x, y.x)

    def step(self, system, t, carried, dt):
        """Positions at t + dt and at t."""
        now, last = carried
        half = system.damping.rate * dt / 2
        a = system.undamped_acceleration(t, now)
        return Positions((2 * now - (1 - half) * last + dt**2 * a) / (1 + half), now)

    def state(self, system, t, carried, dt):
        """Positions and velocities at t."""
        after = self.step(system, t, carried, dt).now
        return Phase(carried.now, (after - carried.last) / (2 * dt))
