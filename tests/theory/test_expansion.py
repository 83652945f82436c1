"""The expansion of a step in dt, against terms in closed form, and the equation that it solves."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

from ropeode import Problem, explain_stepper, load
from ropeode.problems import InextensibleRope
from ropeode.simulation import method_of
from ropeode.theory import StepSamples, expanded
from tests.theory.steps import euler_in_numpy

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


def velocity_of_the_last_step(acceleration, t, x, v, dt, args):
    """The damping acts by a factor per step, and the velocity is a difference of positions."""
    x_new = np.asarray(x) + (1.0 - 5e-5) * dt * v + dt**2 * acceleration(t, x, 0.0 * v, args)
    return x_new, (x_new - x) / dt


def test_the_local_error_of_euler_is_half_the_second_derivative():
    found = expansion(euler_in_numpy)
    t, (x, v) = TIMES[:, None], np.moveaxis(STATES, 1, 0)
    a = -np.sin(x) - RATE * v + 0.4 * np.cos(1.7 * t)
    jerk = -np.cos(x) * v - RATE * a - 0.4 * 1.7 * np.sin(1.7 * t)
    assert found.order == 1
    np.testing.assert_allclose(found.rate(1).value, -0.5 * np.stack([a, jerk], axis=1), rtol=1e-7)


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


def test_what_is_still_settling_shows_no_order():
    problem = InextensibleRope().problem(frames=3)
    samples = StepSamples(problem, method_of("pbd", problem))
    x = problem.y0[0]
    turning = np.stack([x, 0.3 * (x - x[:, :1])[::-1] * np.array([[-1.0], [1.0]])])
    y = turning * np.array([[1.0, 1.0], [1.0, 0.5]])[..., None, None]
    assert expanded(samples, np.zeros(2), y, longest=1.0).order is None


# --- the problem's own equation with other parameters


def euler_of(change):
    """Explicit Euler with a change of its right-hand side, which takes f and the parameters."""

    def step(rhs, t, y, dt, args):
        return y + dt * change(lambda **others: rhs(t, y, args._replace(**others)), y)

    return step


SLOW = pytest.mark.slow


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda f, y: f(sigma=9.0, rho=29.0), "sigma = 9 in place of 10, rho = 29 in place of 28"),
        pytest.param(lambda f, y: f() * [1, -1, 1], "component 1 multiplied by -1", marks=SLOW),
        # No change of parameters makes up for it.
        pytest.param(lambda f, y: f() + 0.1 * y**2, None, marks=SLOW),
    ],
)
def test_what_is_changed_is_named(change, words):
    found = explain_stepper(euler_of(change), load("lorenz"), steps_per_frame=(8, 16)).local.wrong
    if words is None:
        assert found is None
    else:
        assert found.line.startswith(f"it is f with {words}")
