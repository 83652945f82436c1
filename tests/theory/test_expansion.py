"""The expansion of a step in dt, against terms that are known in closed form."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

from ropeode import Problem
from ropeode.problems import InextensibleRope
from ropeode.simulation import method_of
from ropeode.steppers import Phase, Stepper
from ropeode.theory import StepSamples, expanded

RATE = 0.3


def swinging(t, x, v, args):
    """A pendulum with damping and a drive, so that each term of y'' is there."""
    return -jnp.sin(x) - RATE * v + 0.4 * jnp.cos(1.7 * t)


PENDULUM = Problem.second_order(swinging, [1.1, -0.4], [0.3, 0.9], np.linspace(0.2, 2.2, 5))
TIMES = np.array([0.2, 0.9, 1.7])
STATES = np.array(
    [[[1.1, -0.4], [0.3, 0.9]], [[0.2, 0.7], [-1.0, 0.4]], [[-2.0, 1.5], [0.6, -0.8]]]
)


def expansion(stepper, times=TIMES, states=STATES):
    samples = StepSamples(PENDULUM, method_of(stepper, PENDULUM))
    return expanded(samples, times, states, longest=1.0)


def second_derivatives(t, x, v):
    a = np.asarray(-np.sin(x) - RATE * v) + 0.4 * np.cos(1.7 * t)
    return a, -np.cos(x) * v - RATE * a - 0.4 * 1.7 * np.sin(1.7 * t)


def euler(rhs, t, y, dt, args):
    return y + dt * np.asarray(rhs(t, y, args))


def velocity_of_the_last_step(acceleration, t, x, v, dt, args):
    """The damping acts by a factor per step, and the velocity is a difference of positions."""
    x_new = np.asarray(x) + (1.0 - 5e-5) * dt * v + dt**2 * acceleration(t, x, 0.0 * v, args)
    return x_new, (x_new - x) / dt


class Leapfrog(Stepper):
    """The explicit midpoint rule over two steps, whose second root is -1."""

    def init(self, system, t, y, dt):
        y = np.stack([y.x, y.v])
        return y, y - dt * np.asarray(system.rhs(t, y))

    def step(self, system, t, carried, dt):
        y, last = carried
        return last + 2 * dt * np.asarray(system.rhs(t, y)), y

    def state(self, system, t, carried, dt):
        return Phase(*carried[0])


@pytest.mark.parametrize("step", ["explicit-euler", euler])
def test_the_local_error_of_euler_is_half_the_second_derivative(step):
    found = expansion(step)
    a, jerk = (
        np.stack(each)
        for each in zip(*map(lambda t, y: second_derivatives(t, *y), TIMES, STATES), strict=True)
    )
    assert found.order == 1
    np.testing.assert_allclose(found.rate(1).value, -0.5 * np.stack([a, jerk], axis=1), rtol=1e-7)


@pytest.mark.parametrize(
    ("name", "order"),
    [("semi-implicit-euler", 1), ("rk4", 4), ("diffrax:Dopri5", 5), ("scipy:RK23", 3)],
)
def test_the_order_at_a_state_is_the_declared_one(name, order):
    assert expansion(name).order == order


def test_a_step_that_is_not_the_identity_says_what_it_multiplies():
    found = expansion(velocity_of_the_last_step)
    assert found.order == -1
    np.testing.assert_allclose(found.rate(-1).value[:, 1], -5e-5 * STATES[:, 1], rtol=1e-7)
    assert np.all(found.rate(-1).zero[0])


def test_a_state_of_zeros_has_all_digits_of_its_moves():
    still = STATES * np.array([0.0, 1.0])[:, None]
    assert expansion("rk4", states=still).order == 4


def test_rounding_late_in_time_is_not_taken_for_an_error():
    late = expansion("rk4", times=TIMES + 1e6)
    assert late.order in (4, None)
    assert not np.any(late.rate(0).known)


def test_errors_that_change_their_sign_at_each_step_are_told_from_those_that_grow():
    found = expansion(Leapfrog())
    assert not found.one_step
    assert found.order == 2


@pytest.mark.parametrize(
    "stepper",
    [
        "pbd",
        *(
            pytest.param(each, marks=pytest.mark.slow)
            for each in (
                "xpbd:iterations=3",
                "pbd:sweep=jacobi,iterations=2",
                "constraint-verlet:sweeps=1",
                "constraint-verlet:sweeps=3",
            )
        ),
    ],
)
def test_what_is_still_settling_shows_no_order(stepper):
    problem = InextensibleRope().problem(frames=3)
    method = method_of(stepper, problem)
    x, v = problem.y0
    turned = np.stack([x, 0.3 * (x - x[:, :1])[::-1] * np.array([[-1.0], [1.0]])])
    y = np.stack([turned, turned * np.array([1.0, 0.5])[:, None, None]])
    assert np.all(v == 0.0)
    assert expanded(StepSamples(problem, method), np.zeros(2), y, longest=1.0).order is None
