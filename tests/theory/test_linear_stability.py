"""Step limits from the spectrum of a problem, against the growth of the step itself and runs."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from ropeode.problems import PROBLEMS, Problem
from ropeode.references import load
from ropeode.simulation import simulate
from ropeode.steppers import STEPPERS
from ropeode.theory import linear_stability_of, spectral_limit, spectrum_of, stability_function_of
from tests.theory.steps import kick_in_numpy

FOR_FORCES = [name for name, stepper in STEPPERS.items() if not stepper().moves_links]
SLOW, LAGGED = pytest.mark.slow, "stormer-verlet:damping=lagged"


@pytest.fixture(scope="module")
def damped():
    """An oscillator with two real eigenvalues, -0.21 and -4.79; its states are exact."""
    stored = load("oscillator")
    problem = PROBLEMS["oscillator"](damping=5.0, frames=stored.problem.frames)
    return dataclasses.replace(stored, problem=problem, states=problem.exact(problem.ts))


@pytest.mark.parametrize(
    "stepper",
    [kick_in_numpy, *(pytest.param(name, marks=SLOW) for name in (*FOR_FORCES, LAGGED))],
)
def test_what_is_predicted_is_measured(damped, stepper):
    found = linear_stability_of(damped, stepper)
    # What agrees to a thousandth is taken as it was predicted.
    assert found.predicted.steps.dt == pytest.approx(found.measured_at_rest.dt, rel=2e-3)
    known_rates = [-2.5 - 5.25**0.5, -2.5 + 5.25**0.5]
    assert np.sort(found.along.eigenvalues[0].real) == pytest.approx(known_rates)
    # With kicks mu^2 - (2 - 5 dt - dt^2) mu + 1 - 5 dt at mu = -1.
    known = {kick_in_numpy: 29**0.5 - 5, "velocity-verlet": 2.0}
    if stepper in known:
        assert found.measured_at_rest.dt == pytest.approx(known[stepper], rel=1e-5)
        assert found.bounded_from == np.ceil(1 / known[stepper])


def limit_of(problem, stepper, along):
    return spectral_limit(problem, stability_function_of(problem, stepper), along)


def test_the_mode_and_the_time_that_decide():
    # A spring that stiffens with time: x'' = -(1 + t) x.
    problem = Problem.second_order(
        lambda t, x, v, args: -(1.0 + t) * x, [[1.0]], [[0.0]], 0.75 * np.arange(5.0)
    )
    along = spectrum_of(problem, np.array([0.0, 3.0, 1.5]), np.ones((3, 2, 1, 1)))
    found = limit_of(problem, "velocity-verlet", along)
    assert (found.time, found.steps.steps_per_frame) == (3.0, 1)
    assert [abs(found.eigenvalue), found.steps.dt] == pytest.approx([2.0, 1.0], rel=1e-5)


def test_growth_of_the_solution_itself_asks_for_no_step():
    # Upside down: x'' = x grows, whatever the step; a pendulum passes both kinds of states.
    problem = PROBLEMS["pendulum"]()
    states = np.array([0.0, np.pi])[:, None, None, None] * np.array([1.0, 0.0])[:, None, None]
    along = spectrum_of(problem, np.zeros(2), states)
    found = limit_of(problem, "semi-implicit-euler", along)
    assert found.steps.dt == pytest.approx(2.0, rel=1e-5)
    # However slowly the step adds to it.
    assert limit_of(problem, "explicit-euler", along).steps.steps_per_frame is None
    upright = spectrum_of(problem, np.zeros(1), states[1:])
    assert limit_of(problem, "semi-implicit-euler", upright) is None


def test_what_is_kept_forever_has_the_eigenvalue_zero():
    """Concentrations of which the sum is constant; rounding would grow in steps long enough."""
    rates = np.random.default_rng(8).lognormal(sigma=4.0, size=(6, 6))
    exchange = rates - np.diag(np.sum(rates, axis=0))
    problem = Problem(lambda t, y, args: args @ y, np.ones(6), [0.0, 1e12], exchange)
    along = spectrum_of(problem, np.zeros(1), np.ones((1, 6)))
    assert np.count_nonzero(along.eigenvalues) == 5
    assert np.max(np.real(along.eigenvalues)) == 0.0


@pytest.mark.slow
@pytest.mark.parametrize("stepper", FOR_FORCES[1:])
def test_runs_grow_just_past_the_limit_and_not_just_before(stepper):
    """Without eigenvalues: by a small disturbance of rest, in runs one percent to either side."""
    problem = PROBLEMS["oscillator"](damping=0.2, stiffness=4.0, x0=1e-3, frames=1)
    at_rest = spectrum_of(problem, np.zeros(1), np.zeros((1, 2, 1, 1)))
    longest = limit_of(problem, stepper, at_rest).steps.dt
    steps = [(0.99 * longest, False), (1.01 * longest, True)]
    for dt, grows in steps if longest < np.inf else [(1.0, False), (1e3, False)]:
        ts = dt * np.arange(3001.0)
        run = simulate(problem.changed(ts=ts), stepper, 1)
        size = np.max(np.abs(run.states), axis=(1, 2, 3))
        assert (size[-100:].max() > 10 * size[:100].max()) == grows
