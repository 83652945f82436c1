"""Stability functions, limits and regions, and step limits from the spectrum of a problem.

Against closed forms, powers of steps, the growth of the step itself, and runs.
"""

from __future__ import annotations

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

from ropeode.problems import PROBLEMS, Problem, Rope
from ropeode.references import load
from ropeode.simulation import simulate
from ropeode.steppers import STEPPERS
from ropeode.theory import (
    LeadingTerm,
    linear_stability_of,
    spectral_limit,
    spectrum_of,
    stability_function_of,
    stability_limits_of,
    stability_region,
    stable_interval,
)
from tests.theory.steps import (
    AdamsBashforth,
    EulerAndHeunInTurns,
    Ramp,
    kick_in_numpy,
    verlet_in_numpy,
)

FIRST = Problem(lambda t, y, args: -y, np.ones(2), np.arange(2.0))
SECOND = PROBLEMS["oscillator"](damping=0.0)
SLOW = pytest.mark.slow


def kick_and_drift(rhs, t, y, dt, args):
    """Semi-implicit Euler of one who was handed a right-hand side."""
    v = y[1] + dt * rhs(t, y, args)[1]
    return jnp.stack([y[0] + dt * v, v])


def test_growth_of_an_oscillation():
    # ln |R(iy)|: of Euler ln(1 + y^2)/2, of Verlet 0.
    euler = stability_function_of(FIRST, "explicit-euler")
    assert euler.amplification == LeadingTerm(pytest.approx(1 / 2), 2)
    assert stability_function_of(SECOND, "velocity-verlet").amplification is None


@pytest.mark.parametrize(
    ("problem", "step", "imaginary", "real"),
    [
        (FIRST, "explicit-euler", 0.0, 2.0),
        (FIRST, "rk4", 8**0.5, 2.785293563405282),
        (SECOND, kick_and_drift, 2.0, 2 * 2**0.5 - 2),
        (SECOND, verlet_in_numpy, 2.0, None),
        # Hairer, Norsett, Wanner I, section III.2; on the imaginary axis it grows as y^4/4.
        (FIRST, AdamsBashforth(), 0.0, 1.0),
        # What starts as another is judged by how it goes on: of order 4. HNW III.1, HW V.1.
        (FIRST, Ramp, 0.4299870799093243, 0.3),
        # Where |R| leaves 1, with SciPy's tableau: bisected.
        pytest.param(FIRST, "dormand-prince8", 5.960359811702861, None, marks=SLOW),
        # A root of the characteristic polynomial grows at once, if slowly.
        pytest.param(FIRST, "adams-pece3", 0.0, None, marks=SLOW),
    ],
)
def test_methods_have_their_limits(problem, step, imaginary, real):
    found = stability_limits_of(stability_function_of(problem, step))
    assert (found.imaginary.growth is not None) == (imaginary == 0.0)
    assert found.imaginary.limit == pytest.approx(imaginary, rel=1e-9)
    assert real is None or found.real.limit == pytest.approx(real, rel=1e-9)


def test_an_implicit_step_is_stable_as_far_as_was_looked():
    function = stability_function_of(FIRST, "implicit-euler")
    z = np.array([1j, -3.0, 2.0 + 0.5j, -700 + 20j])
    np.testing.assert_allclose(function.radius(z), 1 / np.abs(1 - z), rtol=1e-12)
    limits = stability_limits_of(function, farthest=50.0)
    for interval in (limits.imaginary, limits.real):
        assert (interval.limit, interval.ends, interval.looked_to) == (50.0, False, 50.0)


def test_a_method_with_memory_is_judged_on_all_that_it_carries():
    function = stability_function_of(FIRST, AdamsBashforth())
    z = np.array([0.3 - 0.4j, -0.8, 0.1 + 2.0j])
    roots = [np.roots([1, -1 - 1.5 * each, 0.5 * each]) for each in z]
    np.testing.assert_allclose(function.radius(z), np.abs(roots).max(axis=1), rtol=1e-12)


@pytest.mark.parametrize(("omega", "ratio"), [(0.7, 0.2), (1.9, 0.02)])
def test_damped_oscillators_against_powers_of_the_step(omega, ratio):
    """The radius is the growth in each step of a long run, of the oscillator of the library."""
    function = stability_function_of(SECOND, "velocity-verlet")
    problem = PROBLEMS["oscillator"](stiffness=omega**2, damping=2 * ratio * omega, frames=200)
    x, v = simulate(problem, "velocity-verlet", 1).states[:, :, 0, 0].T
    # An area, which a linear step multiplies by the product of its eigenvalues.
    area = np.abs(x[:-1] * v[1:] - x[1:] * v[:-1])
    rate = np.polyfit(np.arange(200), np.log(np.maximum(area, 1e-300)), 1)[0]
    z = omega * (-ratio + 1j * (1 - ratio**2) ** 0.5)
    assert function.radius(z) == pytest.approx(np.exp(rate / 2), rel=1e-6)


def test_holes_between_the_points_of_a_grid():
    # Stable up to 2 but for a hole between 1.5 and 1.50001 which no grid of hundredths sees.
    def radius(x):
        narrow = 1.0 + 1e-3 - 4e7 * (x - 1.500005) ** 2
        bump = np.where(np.abs(x - 1.500005) < 1e-2, np.maximum(narrow, 0.9 - abs(x - 1.5)), 0.6)
        return np.where(x < 2, bump, 1.5)

    found = stable_interval(radius, np.linspace(0.01, 8.0, 800))
    assert found.limit == pytest.approx(1.5, abs=1e-4)
    assert stable_interval(lambda x: 1.0 + x, np.linspace(0.1, 1, 9)).limit == 0.0
    assert not stable_interval(lambda x: np.exp(-x), np.linspace(0.1, 1, 9)).ends


def test_a_region_shows_its_boundary():
    function = stability_function_of(FIRST, "rk4")
    region = stability_region(function, stability_limits_of(function))
    z = region.real + 1j * region.imaginary[:, None]
    coefficients = [1, 1, 1 / 2, 1 / 6, 1 / 24]
    expected = np.abs(np.polynomial.Polynomial(coefficients)(z))
    np.testing.assert_allclose(region.radius, expected, rtol=1e-12)
    assert region.real[0] < -2.8 < 2.9 < region.imaginary[-1]


def euler(change):
    """Explicit Euler whose slope is multiplied by something else than the step size."""
    return lambda rhs, t, y, dt, args: y + change(t, y, dt) * rhs(t, y, args)


@pytest.mark.parametrize(
    ("why", "step"),
    [
        ("of size 0.000244141 is not that of size 1", euler(lambda t, y, dt: jnp.minimum(dt, 0.5))),
        ("it is not linear", euler(lambda t, y, dt: dt * (jnp.abs(y) >= 1e-3))),
        ("at t = 37.25 it is another step", euler(lambda t, y, dt: dt * (1 - 0.1 * (t > 10)))),
        ("different ways", kick_and_drift),
        ("it raises TypeError", lambda rhs, t, y, dt, args: y if args is None else args["none"]),
        pytest.param("settled", EulerAndHeunInTurns, marks=SLOW),
    ],
)
def test_what_is_no_function_of_dt_lambda_has_none(why, step):
    assert why in stability_function_of(FIRST, step)


def test_steppers_for_links_have_none():
    found = stability_function_of(Rope(num_nodes=4).problem(2), "constraint-verlet")
    assert "needs another kind of problem" in found


def test_damping_that_does_not_scale_is_left_out():
    """The factor 1 - c on each step is no function of dt gamma; without damping all is well."""
    found = stability_function_of(SECOND, "stormer-verlet:damping=per-step")
    assert not found.damped
    limits = stability_limits_of(found)
    assert limits.real is None
    assert limits.imaginary.limit == pytest.approx(2.0)
    assert stability_region(found, limits) is None


# --- step limits from the spectrum of a problem


FOR_FORCES = [name for name, stepper in STEPPERS.items() if not stepper().moves_links]
LAGGED = "stormer-verlet:damping=lagged"


@pytest.fixture(scope="module")
def damped():
    """An oscillator with two real eigenvalues, -0.21 and -4.79; its states are exact."""
    stored = load("oscillator")
    problem = PROBLEMS["oscillator"](damping=5.0, frames=stored.problem.frames)
    return dataclasses.replace(stored, problem=problem, states=problem.exact(problem.ts))


@pytest.mark.parametrize(
    "stepper", [kick_in_numpy, *(pytest.param(name, marks=SLOW) for name in (*FOR_FORCES, LAGGED))]
)
def test_what_is_predicted_is_measured(damped, stepper):
    found = linear_stability_of(damped, stepper)
    assert found.predicted.steps.dt == pytest.approx(found.measured_at_rest.dt, rel=1e-4)
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
