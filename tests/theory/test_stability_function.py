"""Stability functions, limits and regions, against closed forms and powers of steps."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

from ropeode.problems import PROBLEMS, Problem, Rope
from ropeode.simulation import simulate
from ropeode.theory import (
    LeadingTerm,
    stability_function_of,
    stability_limits_of,
    stability_region,
    stable_interval,
)
from tests.theory.steps import AdamsBashforth, EulerAndHeunInTurns, Ramp, verlet_in_numpy

FIRST = Problem(lambda t, y, args: -y, np.ones(2), np.arange(2.0))
SECOND = PROBLEMS["oscillator"](damping=0.0)
SLOW = pytest.mark.slow


def kick_and_drift(rhs, t, y, dt, args):
    """Semi-implicit Euler of one who was handed a right-hand side."""
    v = y[1] + dt * rhs(t, y, args)[1]
    return jnp.stack([y[0] + dt * v, v])


def test_growth_and_phase_of_an_oscillation():
    # ln |R(iy)| and arg R(iy) - y: of Euler ln(1 + y^2)/2 and atan y - y; of Verlet 0 and
    # 2 asin(y/2) - y.
    euler = stability_function_of(FIRST, "explicit-euler")
    assert euler.amplification == LeadingTerm(pytest.approx(1 / 2), 2)
    assert euler.phase == LeadingTerm(pytest.approx(-1 / 3), 3)
    found = stability_function_of(SECOND, "velocity-verlet")
    assert found.amplification is None
    assert found.phase == LeadingTerm(pytest.approx(1 / 24), 3)


def check_limits(function, imaginary, real):
    found = stability_limits_of(function)
    assert (found.imaginary.growth is not None) == (imaginary == 0.0)
    assert not found.a_stable
    assert found.imaginary.limit == pytest.approx(imaginary, rel=1e-9)
    assert real is None or found.real.limit == pytest.approx(real, rel=1e-9)


FACTORIALS = np.array([1, 1, 2, 6, 24, 120])


@pytest.mark.parametrize(
    ("problem", "step", "order", "imaginary", "real"),
    [
        (FIRST, "explicit-euler", 1, 0.0, 2.0),
        (FIRST, "rk4", 4, 8**0.5, 2.785293563405282),
        (SECOND, kick_and_drift, None, 2.0, 2 * 2**0.5 - 2),
        (SECOND, verlet_in_numpy, None, 2.0, None),
        # Where |R| leaves 1, with SciPy's tableau: bisected.
        pytest.param(FIRST, "dormand-prince8", None, 5.960359811702861, None, marks=SLOW),
        # A root of the characteristic polynomial grows at once, if slowly.
        pytest.param(FIRST, "adams-pece3", None, 0.0, None, marks=SLOW),
    ],
)
def test_methods_have_their_polynomials_and_limits(problem, step, order, imaginary, real):
    found = stability_function_of(problem, step)
    check_limits(found, imaginary, real)
    if order:
        assert found.polynomial == pytest.approx(1 / FACTORIALS[: order + 1], abs=1e-14)
        # R/exp - 1 begins with -z^(p+1)/(p+1)!.
        assert found.error == LeadingTerm(pytest.approx(-1 / FACTORIALS[order + 1]), order + 1)


def test_an_implicit_step_is_stable_as_far_as_was_looked():
    function = stability_function_of(FIRST, "implicit-euler")
    assert function.polynomial is None
    z = np.array([1j, -3.0, 2.0 + 0.5j, -700 + 20j])
    np.testing.assert_allclose(function.radius(z), 1 / np.abs(1 - z), rtol=1e-12)
    limits = stability_limits_of(function, farthest=50.0)
    assert limits.a_stable
    assert (limits.real.limit, limits.real.ends, limits.looked_to) == (50.0, False, 50.0)
    assert limits.far_away == pytest.approx(1 / 51)


def test_a_method_with_memory_is_judged_on_all_that_it_carries():
    function = stability_function_of(FIRST, AdamsBashforth())
    assert not function.one_step
    z = np.array([0.3 - 0.4j, -0.8, 0.1 + 2.0j])
    roots = [np.roots([1, -1 - 1.5 * each, 0.5 * each]) for each in z]
    np.testing.assert_allclose(function.radius(z), np.abs(roots).max(axis=1), rtol=1e-12)
    # Order 2 with the error constant 5/12, Hairer, Norsett, Wanner I, section III.2.
    assert function.error == LeadingTerm(pytest.approx(-5 / 12), 3)
    # The real axis in closed form; on the imaginary axis it grows as y^4/4.
    check_limits(function, 0.0, 1.0)


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


def test_holes_and_islands():
    # Stable up to 1, a hole between 1.5 and 1.50001 which no grid of hundredths sees, and again
    # between 3 and 4.
    def radius(x):
        narrow = 1.0 + 1e-3 - 4e7 * (x - 1.500005) ** 2
        bump = np.where(np.abs(x - 1.500005) < 1e-2, np.maximum(narrow, 0.9 - abs(x - 1.5)), 0.6)
        return np.where((x < 2) | ((x > 3) & (x < 4)), bump, 1.5)

    found = stable_interval(radius, np.linspace(0.01, 8.0, 800))
    assert found.limit == pytest.approx(1.5, abs=1e-4)
    assert [pytest.approx(each, abs=1e-4) for each in found.islands] == [(1.5, 2.0), (3.0, 4.0)]
    assert stable_interval(lambda x: 1.0 + x, np.linspace(0.1, 1, 9)).limit == 0.0
    assert not stable_interval(lambda x: np.exp(-x), np.linspace(0.1, 1, 9)).ends


def test_a_region_shows_its_boundary():
    function = stability_function_of(FIRST, "rk4")
    region = stability_region(function, stability_limits_of(function))
    z = region.real + 1j * region.imaginary[:, None]
    expected = np.abs(1 + z + z**2 / 2 + z**3 / 6 + z**4 / 24)
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
    assert why in stability_function_of(FIRST, step).reason


def test_steppers_for_links_have_none():
    found = stability_function_of(Rope(num_nodes=4).problem(2), "constraint-verlet")
    assert "needs another kind of problem" in found.reason


def test_damping_that_does_not_scale_is_left_out():
    """The factor 1 - c on each step is no function of dt gamma; without damping all is well."""
    found = stability_function_of(SECOND, "stormer-verlet:damping=per-step")
    assert not found.damped
    limits = stability_limits_of(found)
    assert (limits.real, limits.a_stable) == (None, None)
    assert limits.imaginary.limit == pytest.approx(2.0)
    assert stability_region(found, limits) is None


def test_a_method_that_starts_as_another_is_judged_by_how_it_goes_on():
    found = stability_function_of(FIRST, Ramp)
    limits = stability_limits_of(found)
    # Of the fourth-order method: HNW III.1, HW V.1.
    assert limits.imaginary.limit == pytest.approx(0.42998708, abs=1e-6)
    assert limits.real.limit == pytest.approx(0.3, abs=1e-9)
    assert found.error == LeadingTerm(pytest.approx(-251 / 720, rel=1e-6), 5)
