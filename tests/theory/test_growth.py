"""Equilibria, their modes, and the growth that steppers add, against closed forms and runs."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import linalg

from ropeode.analysis import hanging_equilibrium, normal_modes
from ropeode.errors import InputError
from ropeode.problems import PROBLEMS, InextensibleRope, Problem, Rope
from ropeode.simulation import simulate
from ropeode.steppers import STEPPERS
from ropeode.theory import growth_per_frame, stability_limit
from tests.theory.steps import EulerAndHeunInTurns, Ramp, euler_in_numpy

SLOW = pytest.mark.slow
SMALL = {"num_nodes": 4, "start": (0, 0), "end": (-60, 0)}


def small(**given) -> Problem:
    return Rope(**{**SMALL, **given}).problem(2)


def hanging_chain(mass, stiffness, length):
    """Positions below the pin, and frequencies: each spring bears all that is below it."""
    tension = np.cumsum(mass[:0:-1])[::-1]
    place = np.append(0, np.cumsum(length + tension / stiffness))
    found = []
    # Along the rope its springs, and tension/length across it.
    for spring in (stiffness, tension / np.diff(place)):
        gaps = np.diff(np.eye(len(mass)), axis=0)[:, 1:]
        matrix = gaps.T @ np.diag(spring) @ gaps
        found.append(linalg.eigh(matrix, np.diag(mass[1:]), eigvals_only=True))
    return place, np.sort(np.sqrt(np.concatenate(found)))


OMEGA = hanging_chain(np.ones(4), np.full(3, 100.0), 20.0)[1]


def euler_rate(steps, omega, damping):
    """Explicit Euler multiplies a mode by 1 + dt z with z^2 + r z + omega^2 = 0."""
    z = -damping / 2 + np.emath.sqrt(damping**2 / 4 - np.asarray(omega) ** 2)
    return steps * np.max(np.log1p((2 * z.real + np.abs(z) ** 2 / steps) / steps) / 2)


@pytest.mark.parametrize("end", [(20, 10), (0, 30)], ids=["slant", "upright"])
def test_a_rope_of_unequal_parts_hangs_and_oscillates_as_it_must(end):
    mass, stiffness = np.array([1.0, 2.0, 0.5, 1.5]), np.array([80.0, 150.0, 60.0])
    problem = small(end=end, node_mass=mass, stiffness=stiffness)
    y = hanging_equilibrium(problem)
    place, omega = hanging_chain(mass, stiffness, np.hypot(*end) / 3)
    np.testing.assert_allclose(y, [[0 * place, -place], np.zeros((2, 4))], atol=1e-12)
    np.testing.assert_allclose(normal_modes(problem, y).frequencies, omega, rtol=1e-11)


def test_a_rope_between_two_pins():
    # By symmetry the middle node hangs at 10 and the two springs bear its weight:
    # 2 k (s - 10) y/s = 1 with s^2 = 100 + y^2.
    x, y = hanging_equilibrium(small(end=(30, 0), pinned=(0, 2, 3)))[0][:, 1]
    s = np.hypot(10, y)
    assert (x, 200 * (s - 10) * -y / s) == pytest.approx((10, 1), rel=1e-10)


def test_rigid_links():
    # Three links of length 5 and equal masses: omega^2 = g/l times the zeros of the Laguerre
    # polynomial of degree 3 (D. Bernoulli, 1733).
    problem = InextensibleRope(num_nodes=4, start=(0, 0), end=(-15, 0)).problem(2)
    y = hanging_equilibrium(problem)
    np.testing.assert_allclose(y[0], [[0, 0, 0, 0], [0, -5, -10, -15]], atol=1e-12)
    expected = np.sqrt(np.polynomial.laguerre.lagroots([0, 0, 0, 1]) / 5)
    np.testing.assert_allclose(normal_modes(problem, y).frequencies, expected, rtol=1e-11)


@pytest.mark.parametrize(("stepper", "digits"), [("explicit-euler", 1e-12), (euler_in_numpy, 1e-9)])
def test_an_oscillator(stepper, digits):
    """At rest at zero, where differences need the size of the problem."""
    problem = PROBLEMS["oscillator"](stiffness=4.0, mass=2.0)
    assert normal_modes(problem, hanging_equilibrium(problem))[0] == pytest.approx([2**0.5])
    # z^2 + z/20 + 2 = 0.
    found = growth_per_frame(problem, stepper, 16)
    assert found.rate == pytest.approx(euler_rate(16, 2**0.5, 0.05), rel=digits)


# Springs of length 10 under the weight of one to three nodes: an unstable equilibrium.
UPRIGHT = np.stack([[[0, 0, 0, 0], [0, 9.97, 19.95, 29.94]], np.zeros((2, 4))])
FIRST_ORDER = Problem(lambda t, y, args: -y, [1.0], [0.0, 1.0])
DRIVEN = Problem.second_order(lambda t, x, v, args: t - x, [1.0], [0.0], [0.0, 1.0])


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: hanging_equilibrium(PROBLEMS["kepler"]()), "with a stable equilibrium"),
        (lambda: hanging_equilibrium(small(pinned=(0, 1, 2, 3))), "in which something can move"),
        (lambda: hanging_equilibrium(FIRST_ORDER), "second-order"),
        (lambda: hanging_equilibrium(DRIVEN), "does not depend on time"),
        (lambda: growth_per_frame(small(), "explicit-euler", 0), "steps_per_frame: 0 given"),
        (lambda: normal_modes(small(end=(0, 30)), UPRIGHT), "y: .* allowed: a stable equilibrium"),
        pytest.param(lambda: stability_limit(small(), EulerAndHeunInTurns), "settled", marks=SLOW),
    ],
)
def test_misuse(call, words):
    with pytest.raises(InputError, match=words):
        call()


def damped_rate(steps, omega, damping):
    """mu^2 - (2 - r dt - (omega dt)^2) mu + 1 - r dt = 0: complex roots have |mu|^2 = 1 - r dt."""
    return steps * np.log1p(-damping / steps) / 2


@pytest.mark.parametrize(
    ("name", "closed_form", "steps", "damping"),
    [
        ("explicit-euler", euler_rate, 16, 0.0),
        ("explicit-euler", euler_rate, 1024, 0.1),
        ("explicit-euler", euler_rate, 65536, 0.01),
        ("semi-implicit-euler", damped_rate, 65536, 0.1),
        ("stormer-verlet", damped_rate, 16, 0.0),
        ("stormer-verlet", damped_rate, 65536, 0.0),
    ],
)
def test_growth_is_that_of_the_closed_form(name, closed_form, steps, damping):
    expected = closed_form(steps, OMEGA, damping)
    found = growth_per_frame(small(damping=damping), name, steps)
    assert abs(found.rate - expected) <= found.tolerance
    # A few roundings in each step; where the velocity is a difference of positions, a rounding
    # of these moves it by n of them.
    each_step = 5e-15 * (steps if name == "stormer-verlet" else 1)
    assert found.tolerance < 1e-13 + each_step * steps
    assert found.stable == (expected <= 0)
    blow_up = None if found.stable else np.ceil(53 * np.log(2) / found.rate)
    assert found.predicted_blow_up == blow_up


@pytest.mark.parametrize(("name", "steps"), [("explicit-euler", 512), ("semi-implicit-euler", 9)])
def test_runs_grow_as_predicted(name, steps):
    # Semi-implicit Euler is unstable from omega = 18 on; the fastest mode is at 18.04.
    problem = small(stiffness=100.2)
    y = hanging_equilibrium(problem)
    predicted = growth_per_frame(problem, name, steps, y)
    assert predicted.rate > 0.1
    # From a disturbance of 1e-10 (which is 1000 roundings) to a thousandth of a spring, where
    # forces stop to be linear. Over this span a slope is good to a percent.
    frames = int(np.log(1e7) / predicted.rate)
    disturbance = 1e-10 * np.random.default_rng(1).normal(size=y.shape) * problem.args.free
    run = simulate(problem.changed(y0=y + disturbance, ts=np.arange(frames + 1.0)), name, steps)
    scaled = (run.states - y)[:, :, 1] * np.array([predicted.frequency, 1.0])[:, None]
    later = np.arange(frames // 2, frames + 1)
    slope = np.polyfit(later, np.log(np.linalg.norm(scaled, axis=(1, 2))[later]), 1)[0]
    assert slope == pytest.approx(predicted.rate, rel=0.01)


@pytest.mark.parametrize(
    ("stepper", "damping", "limit"),
    [
        # |1 + dt z| < 1 where dt < r/omega^2, for the largest omega of all; without r never.
        ("explicit-euler", 0.1, OMEGA[-1] ** 2 / 0.1),
        ("explicit-euler", 0.0, None),
        # omega dt < 2 for the one, 2 sqrt(2) for the other.
        ("velocity-verlet", 0.0, OMEGA[-1] / 2),
        ("rk4", 0.0, OMEGA[-1] / 8**0.5),
    ],
)
def test_limits_of_a_rope(stepper, damping, limit):
    problem = small(damping=damping)
    assert stability_limit(problem, stepper) == (limit and np.ceil(limit))
    if stepper == "explicit-euler" and damping:
        # The straight rope at rest: docs/explanation/stability.md has its frequencies.
        omega = 20 * np.sin(5 * np.pi / 14)
        assert stability_limit(problem, stepper, problem.y0) == np.ceil(omega**2 / damping)


def test_damping_per_step_grows_with_the_steps():
    # The factor 1 - c on each step is a rate of c n per frame; modes slower than it creep at
    # omega^2/(c n), the slowest of all sets the pace.
    found = growth_per_frame(small(damping=0.1), "stormer-verlet:damping=per-step", 1024)
    assert found.rate == pytest.approx(-(OMEGA[0] ** 2) / 102.4, rel=0.01)


@pytest.mark.parametrize(
    "name", ["constraint-verlet", *(pytest.param(each, marks=SLOW) for each in STEPPERS)]
)
def test_every_stepper_can_be_linearised(name):
    problem = (Rope if name != "rattle" else InextensibleRope)(**SMALL, damping=0.1).problem(2)
    found = growth_per_frame(problem, name, 5000)
    assert found.stable
    assert -0.06 < found.rate < 0


@pytest.mark.parametrize(
    ("unstable", "limit"),
    # The search finds 3, which is stable; twice and four times as many are looked at again.
    [({1, 2, *range(6, 12)}, 12), ({1, 2, *range(10, 14)}, 14)],
)
def test_a_stepper_may_be_unstable_again_with_more_steps(unstable, limit):
    problem = PROBLEMS["oscillator"]()

    def step(acceleration, t, x, v, dt, args):
        factor = 2.0 if round(problem.ts[1] / dt) in unstable else 0.5
        return factor * np.asarray(x), factor * np.asarray(v)

    assert stability_limit(problem, step) == limit


@SLOW
# Of equinox, which differentiates the loop.
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_a_loop_that_is_differentiated_backwards_only():
    problem = PROBLEMS["oscillator"](stiffness=100.0, damping=0.5)
    found, expected = (growth_per_frame(problem, each, 20) for each in ("diffrax:Heun", "heun"))
    assert found.rate == pytest.approx(expected.rate, rel=1e-9)


@SLOW
def test_a_method_that_starts_as_another_grows_as_it_goes_on():
    problem = PROBLEMS["oscillator"](stiffness=400.0)
    assert stability_limit(problem, Ramp) == stability_limit(problem, "adams-bashforth4")
