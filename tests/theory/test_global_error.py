"""The predicted leading term of the global error, against what is known in closed form."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

from ropeode import Problem, reference
from ropeode.problems import PROBLEMS, LinearDamping
from ropeode.simulation import method_of
from ropeode.theory import predicted_error
from tests.exact_reference import exact_reference
from tests.theory.steps import WithMemory

TIMES = np.linspace(0.0, 3.0, 7)


# An oscillator without damping, released at rest, and its exact solution.
KNOWN = exact_reference(
    Problem.second_order(
        lambda t, x, v, args: -x,
        [0.8],
        [0.0],
        TIMES,
        damping=lambda args: LinearDamping(jnp.zeros(()), jnp.zeros(())),
    ),
    0.8 * np.stack([np.cos(TIMES), -np.sin(TIMES)], axis=1)[..., None],
)
X, V = np.moveaxis(KNOWN.states, 1, 0)
T = TIMES[:, None]


def predicted(stepper, known=KNOWN):
    return predicted_error(known, method_of(stepper, known.problem))


@pytest.mark.parametrize(
    ("stepper", "order", "positions", "velocities"),
    [
        # Each step lacks dt**2/2 y'', so that e' = J e + y/2 and e = t y/2.
        ("explicit-euler", 1, T * X / 2, T * V / 2),
        # The solution half a step later, whose velocity is shown half a step earlier.
        ("semi-implicit-euler", 1, V / 2, 0.0 * V),
        # It starts with half a step of acceleration too much.
        pytest.param("stormer-verlet:start=rest", 1, V / 2, -X / 2, marks=pytest.mark.slow),
        # The frequency is too high by dt**2/24, and the velocities too small by another factor.
        ("velocity-verlet", 2, T * V / 24, -T * X / 24 - V / 8),
    ],
)
def test_the_error_of_an_oscillator(stepper, order, positions, velocities):
    found = predicted(stepper)
    assert found.order == order
    expected = np.stack([positions, velocities], axis=1)
    np.testing.assert_allclose(found.states, expected, atol=1e-5)
    assert found.uncertain < 1e-4


class TwoStepMidpoint(WithMemory):
    """``y(t + dt) = y(t - dt) + 2 dt f``, whose other root is -1, started by a step of Euler's."""

    def init(self, system, t, y, dt):
        return y, y - dt * system.rhs(t, y)

    def step(self, system, t, carried, dt):
        y, before = carried
        return before + 2 * dt * system.rhs(t, y), y


def test_what_swings_from_step_to_step_is_not_predicted():
    """A start of order 1 sets a root -1 swinging, which adds to the error what runs show."""
    assert "swings from step to step" in str(predicted(TwoStepMidpoint()))


def test_what_settles_slowly_is_not_predicted():
    """Slopes from before the start: the first steps' own errors look like growth for long."""
    found = str(predicted("adams-bashforth3:start=euler"))
    assert "settles slowly: 2 steps more change it by" in found


@pytest.mark.slow
def test_frames_that_pieces_of_the_solution_fill_but_for_rounding():
    """What was left of a frame, less than one unit of time's last place, stood in it twice."""
    orbit = PROBLEMS["kepler"](frames=3, eccentricity=0.1)
    assert predicted("rk4", reference(orbit)).order == 4


def test_a_single_frame_has_a_prediction():
    """Its solution may be known at seven states only."""
    once = exact_reference(KNOWN.problem.changed(ts=TIMES[:2]), KNOWN.states[:2])
    whole, one = predicted("rk4"), predicted("rk4", once)
    np.testing.assert_allclose(one.states, whole.states[:2], rtol=1e-3, atol=1e-6)


def followed(rhs, y, times=TIMES):
    """A problem with a state of one number, and its solution in closed form."""
    problem = Problem(rhs, y(times[:1]), times)
    return exact_reference(problem, y(times)[:, None])


# Of slopes that depend on time alone; floor(t) jumps where a frame ends.
CORNERS = {
    "corner": (lambda t: jnp.abs(t - 0.737), lambda t: (t - 0.737) * abs(t - 0.737) / 2),
    "jump": (lambda t: t + 1.0 * (t > 1.234), lambda t: t**2 / 2 + np.maximum(0.0, t - 1.234)),
    "floor": (
        lambda t: t + jnp.floor(t),
        lambda t: t**2 / 2 + np.floor(t) * (np.floor(t) - 1) / 2 + np.floor(t) * (t % 1),
    ),
}


@pytest.mark.parametrize("name", ["corner", "floor", pytest.param("jump", marks=pytest.mark.slow)])
def test_corners_are_not_called_stiff(name):
    slope, solution = CORNERS[name]
    known = followed(lambda t, y, args: slope(t) + 0.0 * y, solution)
    assert "t =" in str(predicted("explicit-euler", known))


def test_what_decays_fast_all_along_is_called_stiff():
    fast = followed(lambda t, y, args: -1e6 * (y - jnp.cos(t)) - jnp.sin(t), np.cos)
    assert "stiff" in str(predicted("explicit-euler", fast))
