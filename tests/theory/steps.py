"""Steps as users write them, and Runge-Kutta methods, drawn at random or published."""

from __future__ import annotations

from fractions import Fraction

import diffrax
import jax.numpy as jnp
import numpy as np
from hypothesis import strategies as st

from ropeode.steppers import Stepper
from ropeode.tableaus import NystromTableau, Tableau


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


# --- methods by their tableaus


coefficients = st.fractions(min_value=-3, max_value=3, max_denominator=24)


@st.composite
def rows(draw, stages):
    """A matrix with zeros on and above the diagonal."""
    return tuple(
        tuple(draw(coefficients) if j < i else Fraction(0) for j in range(stages))
        for i in range(stages)
    )


def row(stages):
    return st.tuples(*[coefficients] * stages)


@st.composite
def explicit_tableaus(draw, most_stages=5):
    stages = draw(st.integers(1, most_stages))
    return Tableau(draw(rows(stages)), draw(row(stages)), draw(row(stages)))


@st.composite
def nystrom_tableaus(draw, most_stages=4):
    stages = draw(st.integers(1, most_stages))
    p, a = draw(rows(stages)), draw(rows(stages))
    q, b, c, d = (draw(row(stages)) for _ in range(4))
    return NystromTableau(p, q, a, b, c, d)


def step_of(tableau):
    """A step function that takes the slopes of a tableau, as its author writes it in NumPy."""

    def step(rhs, t, y, dt, args):
        return tableau.step(lambda t, y: rhs(t, y, args), t, y, dt)

    def second_order_step(acceleration, t, x, v, dt, args):
        return tableau.step(lambda t, x, v: acceleration(t, x, v, args), t, x, v, dt)

    return step if isinstance(tableau, Tableau) else second_order_step


def of_diffrax(name):
    """The tableau that diffrax publishes with a solver."""
    own = getattr(diffrax, name).tableau
    return Tableau.of([[], *own.a_lower], own.b_sol, [0.0, *own.c])
