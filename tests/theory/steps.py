"""Steps as users write them, which several tests look at."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np

from ropeode.steppers import Stepper


def euler_in_numpy(rhs, t, y, dt, args):
    return np.asarray(y) + dt * np.asarray(rhs(t, y, args))


def kick_in_numpy(acceleration, t, x, v, dt, args):
    """Semi-implicit Euler."""
    v = np.asarray(v) + dt * np.asarray(acceleration(t, x, v, args))
    return np.asarray(x) + dt * v, v


def verlet_in_numpy(acceleration, t, x, v, dt, args):
    v = np.asarray(v + dt / 2 * acceleration(t, x, v, args))
    x = np.asarray(x + dt * v)
    return x, v + dt / 2 * np.asarray(acceleration(t + dt, x, v, args))


class WithMemory(Stepper):
    """The first of what it carries is the state."""

    equal_frames = True

    def state(self, system, t, carried, dt):
        return carried[0]


class AdamsBashforth(WithMemory):
    """The two-step method, after steps of explicit Euler; it counts time in what it carries.

    Arguments:
        first: how many steps are Euler's.
    """

    def __init__(self, first=1):
        self.first = first

    def init(self, system, t, y, dt):
        return y, 0.0 * y, jnp.asarray(t), jnp.asarray(0)

    def step(self, system, t, carried, dt):
        y, before, since, made = carried
        k = system.rhs(t, y)
        weighted = jnp.where(made < self.first, k, 1.5 * k - 0.5 * before)
        return y + dt * weighted, k, since + dt, made + 1


_WEIGHTS = np.array([[24, 0, 0, 0], [36, -12, 0, 0], [46, -32, 10, 0], [55, -59, 37, -9]]) / 24.0


class Ramp(WithMemory):
    """Adams-Bashforth of order 1, 2, 3, and then 4, by a counter."""

    def init(self, system, t, y, dt):
        return y, (0.0 * y,) * 3, jnp.asarray(0)

    def step(self, system, t, carried, dt):
        y, old, count = carried
        slopes = (system.rhs(t, y), *old)
        weights = jnp.asarray(_WEIGHTS)[jnp.minimum(count, 3)]
        y = y + dt * sum((w * f for w, f in zip(weights, slopes, strict=True)), 0.0 * y)
        return y, slopes[:3], count + 1


class EulerAndHeunInTurns(Ramp):
    def step(self, system, t, carried, dt):
        y, old, count = carried
        slope = system.rhs(t, y)
        again = system.rhs(t + dt, y + dt * slope)
        share = jnp.where(count % 2 == 0, 0.0, 0.5)
        return y + dt * ((1.0 - share) * slope + share * again), old, count + 1
