"""Step limits from the spectrum of a problem, against the growth of the step itself and runs."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from ropeode import reference
from ropeode.analysis import hanging_equilibrium
from ropeode.problems import PROBLEMS, Problem, Rope
from ropeode.references import load
from ropeode.simulation import simulate
from ropeode.steppers import STEPPERS
from ropeode.theory import (
    StabilityFunction,
    linear_stability_of,
    spectral_limit,
    spectrum_of,
    stability_function_of,
)

FOR_FORCES = [name for name, stepper in STEPPERS.items() if not stepper().moves_links]
# What agrees to a thousandth is taken as it was predicted.
CLOSE = 2e-3
# A few dozen roundings of the numbers in a step.
HIDDEN = 1e-14


def kick_in_numpy(acceleration, t, x, v, dt, args):
    v = np.asarray(v) + dt * np.asarray(acceleration(t, x, v, args))
    return np.asarray(x) + dt * v, v


@pytest.fixture(scope="module")
def damped():
    """An oscillator with two real eigenvalues, -0.21 and -4.79; its states are exact."""
    stored = load("oscillator")
    problem = PROBLEMS["oscillator"](damping=5.0, frames=stored.problem.frames)
    assert problem.exact is not None
    return dataclasses.replace(stored, problem=problem, states=problem.exact(problem.ts))


@pytest.mark.parametrize(
    "stepper",
    [
        "velocity-verlet",
        kick_in_numpy,
        pytest.param("explicit-euler", marks=pytest.mark.slow),
        pytest.param("stormer-verlet:damping=lagged", marks=pytest.mark.slow),
    ],
)
def test_what_is_predicted_is_measured(damped, stepper):
    found = linear_stability_of(damped, stepper)
    assert found.predicted is not None
    assert found.measured_at_rest is not None
    assert found.predicted.steps.dt == pytest.approx(found.measured_at_rest.dt, rel=CLOSE)
    slow, fast = np.sort(found.along.eigenvalues[0].real)[::-1]
    assert (slow, fast) == (pytest.approx(-2.5 + 5.25**0.5), pytest.approx(-2.5 - 5.25**0.5))
    # |1 + dt lambda| < 1; with kicks mu^2 - (2 - 5 dt - dt^2) mu + 1 - 5 dt at mu = -1.
    known = {"explicit-euler": -2 / fast, kick_in_numpy: (29**0.5 - 5), "velocity-verlet": 2.0}
    if stepper in known:
        assert found.measured_at_rest.dt == pytest.approx(known[stepper], rel=1e-5)
        assert found.bounded_from == np.ceil(1 / known[stepper])


def test_the_mode_and_the_time_that_decide():
    # A spring that stiffens with time: x'' = -(1 + t) x.
    problem = Problem.second_order(
        lambda t, x, v, args: -(1.0 + t) * x, [[1.0]], [[0.0]], 0.75 * np.arange(5.0)
    )
    function = stability_function_of(problem, "velocity-verlet")
    assert isinstance(function, StabilityFunction)
    times = np.array([0.0, 3.0, 1.5])
    found = spectral_limit(problem, function, spectrum_of(problem, times, np.ones((3, 2, 1, 1))))
    assert found is not None
    assert (found.time, abs(found.eigenvalue)) == (3.0, pytest.approx(2.0))
    assert found.steps.steps_per_frame == 1
    assert found.steps.dt == pytest.approx(1.0, rel=1e-5)
    assert found.fastest_growth == 0.0


def test_growth_of_the_solution_itself_asks_for_no_step():
    # Upside down: x'' = x grows, whatever the step; a pendulum passes both kinds of states.
    problem = PROBLEMS["pendulum"]()
    states = np.array([0.0, np.pi])[:, None, None, None] * np.array([1.0, 0.0])[:, None, None]
    along = spectrum_of(problem, np.zeros(2), states)
    assert along.fastest_growth == pytest.approx(1.0)
    function = stability_function_of(problem, "semi-implicit-euler")
    assert isinstance(function, StabilityFunction)
    found = spectral_limit(problem, function, along)
    assert found is not None
    assert found.steps.dt == pytest.approx(2.0, rel=1e-5)
    upright = spectrum_of(problem, np.zeros(1), states[1:])
    assert spectral_limit(problem, function, upright) is None


def test_what_is_kept_forever_has_the_eigenvalue_zero():
    """Concentrations of which the sum is constant; rounding would grow in steps long enough."""
    rates = np.random.default_rng(8).lognormal(sigma=4.0, size=(6, 6))
    exchange = rates - np.diag(np.sum(rates, axis=0))
    problem = Problem(lambda t, y, args: args @ y, np.ones(6), [0.0, 1e12], exchange)
    along = spectrum_of(problem, np.zeros(1), np.ones((1, 6)))
    assert np.count_nonzero(along.eigenvalues) == 5
    assert np.max(np.real(along.eigenvalues)) == 0.0


def test_slow_growth_is_told_however_slow():
    problem = PROBLEMS["oscillator"](damping=0.0)
    function = stability_function_of(problem, "explicit-euler")
    assert isinstance(function, StabilityFunction)
    found = spectral_limit(
        problem, function, spectrum_of(problem, np.zeros(1), np.zeros((1, 2, 1, 1)))
    )
    assert found is not None
    assert (found.steps.steps_per_frame, found.steps.dt) == (None, 0.0)


@pytest.mark.slow
@pytest.mark.parametrize(
    "problem",
    [
        Rope(num_nodes=5, start=(0, 0), end=(-60, 0)).problem(4),
        Rope(num_nodes=5, start=(0, 0), end=(-60, 0), damping=0.3).problem(4),
        PROBLEMS["pendulum"](),
        PROBLEMS["oscillator"](damping=0.3, stiffness=30.0),
        PROBLEMS["linear-chain"](frames=4),
    ],
    ids=["rope", "damped rope", "pendulum", "oscillator", "chain"],
)
@pytest.mark.parametrize("stepper", [*FOR_FORCES, "stormer-verlet:damping=lagged"])
def test_predicted_limits_are_those_of_the_step_itself(problem, stepper):
    found = linear_stability_of(reference(problem), stepper)
    assert found.predicted_at_rest is not None
    assert found.measured_at_rest is not None
    predicted, measured = found.predicted_at_rest.steps, found.measured_at_rest
    if predicted.steps_per_frame is None and measured.steps_per_frame is not None:
        # It grows at every step size, in the end by less than a step's roundings.
        assert any("rounding hides that" in note for note in found.notes)
        assert isinstance(found.function, StabilityFunction)
        modes = spectrum_of(problem, problem.ts[:1], hanging_equilibrium(problem)[None])
        z = measured.dt * modes.eigenvalues[0]
        assert 0 < np.max(found.function.radius(z, np.conj(z))) - 1 < HIDDEN
        return
    assert predicted.steps_per_frame == measured.steps_per_frame
    assert predicted.dt == pytest.approx(measured.dt, rel=CLOSE)


@pytest.mark.slow
@pytest.mark.parametrize("stepper", FOR_FORCES[1:])
def test_runs_grow_just_past_the_limit_and_not_just_before(stepper):
    """Without eigenvalues: by a small disturbance of rest, in runs one percent to either side."""
    problem = PROBLEMS["oscillator"](damping=0.2, stiffness=4.0, x0=1e-3, frames=1)
    function = stability_function_of(problem, stepper)
    assert isinstance(function, StabilityFunction)
    at_rest = spectrum_of(problem, np.zeros(1), np.zeros((1, 2, 1, 1)))
    limit = spectral_limit(problem, function, at_rest)
    assert limit is not None
    steps = [(0.99 * limit.steps.dt, False), (1.01 * limit.steps.dt, True)]
    if limit.steps.dt == np.inf:
        steps = [(1.0, False), (1e3, False)]
    for dt, grows in steps:
        ts = dt * np.arange(3001.0)
        run = simulate(problem.changed(ts=ts), stepper, 1)
        size = np.max(np.abs(run.states), axis=(1, 2, 3))
        assert (size[-100:].max() > 10 * size[:100].max()) == grows
