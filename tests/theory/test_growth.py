"""Equilibria, their modes, and the growth that steppers add, against closed forms and runs."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy import linalg

from ropeode.analysis import frequencies, hanging_equilibrium
from ropeode.errors import InputError
from ropeode.problems import PROBLEMS, InextensibleRope, Problem, Rope
from ropeode.simulation import simulate
from ropeode.theory import growth_per_frame, stability_limit
from tests.steppers.every_variant import every_name
from tests.theory.steps import EulerAndHeunInTurns, Ramp, euler_in_numpy, heun

MASS, STIFFNESS = np.array([1.0, 2.0, 0.5, 1.5]), np.array([80.0, 150.0, 60.0])
SMALL = {"num_nodes": 4, "start": (0, 0), "end": (-60, 0)}


def small(**given) -> Problem:
    return Rope(**{**SMALL, **given}).problem(2)


def hanging_chain(mass, stiffness, length, gravity):
    """Positions below the pin, and tensions: each spring bears all that is below it."""
    tension = gravity * np.cumsum(mass[:0:-1])[::-1]
    return np.concatenate([[0], np.cumsum(length + tension / stiffness)]), tension


def stiffness_matrices(mass, stiffness, length, gravity):
    """Of a hanging chain: the springs along the rope, and tension/length across it."""
    place, tension = hanging_chain(mass, stiffness, length, gravity)
    for spring in (stiffness, tension / np.diff(place)):
        full = np.diag(np.append(spring, 0) + np.append(0, spring))
        yield (full - np.diag(spring, 1) - np.diag(spring, -1))[1:, 1:]


def chain_frequencies(mass, stiffness, length, gravity):
    found = [
        linalg.eigh(each, np.diag(mass[1:]), eigvals_only=True)
        for each in stiffness_matrices(mass, stiffness, length, gravity)
    ]
    return np.sort(np.sqrt(np.concatenate(found)))


OF_SMALL = (np.ones(4), np.full(3, 100.0), 20.0, 1.0)
OMEGA = chain_frequencies(*OF_SMALL)


def euler_rate(steps, omega, damping):
    """Explicit Euler multiplies a mode by 1 + dt z with z^2 + r z + omega^2 = 0."""
    z = -damping / 2 + np.emath.sqrt(damping**2 / 4 - np.asarray(omega) ** 2)
    return steps * np.max(np.log1p((2 * z.real + np.abs(z) ** 2 / steps) / steps) / 2)


@pytest.mark.parametrize("end", [(20, 10), (0, 30)], ids=["slant", "upright"])
def test_a_rope_of_unequal_parts_hangs_and_oscillates_as_it_must(end):
    problem = Rope(
        num_nodes=4, start=(0, 0), end=end, node_mass=tuple(MASS), stiffness=tuple(STIFFNESS)
    ).problem(2)
    y = hanging_equilibrium(problem)
    place, _ = hanging_chain(MASS, STIFFNESS, np.hypot(*end) / 3, 1.0)
    np.testing.assert_allclose(y[0], [0 * place, -place], atol=1e-12)
    assert not np.any(y[1])
    expected = chain_frequencies(MASS, STIFFNESS, np.hypot(*end) / 3, 1.0)
    np.testing.assert_allclose(frequencies(problem, y), expected, rtol=1e-11)


def test_a_rope_between_two_pins():
    # By symmetry the middle node hangs at 10 and the two springs bear its weight:
    # 2 k (s - 10) y/s = 1 with s^2 = 100 + y^2.
    x, y = hanging_equilibrium(small(end=(30, 0), pinned=(0, 2, 3)))[0][:, 1]
    assert x == pytest.approx(10)
    s = np.hypot(10, y)
    assert 200 * (s - 10) * -y / s == pytest.approx(1, rel=1e-10)


def test_rigid_links():
    # Three links of length 5 and equal masses: omega^2 = g/l times the zeros of the Laguerre
    # polynomial of degree 3 (D. Bernoulli, 1733).
    problem = InextensibleRope(num_nodes=4, start=(0, 0), end=(-15, 0)).problem(2)
    y = hanging_equilibrium(problem)
    np.testing.assert_allclose(y[0], [[0, 0, 0, 0], [0, -5, -10, -15]], atol=1e-12)
    expected = np.sqrt(np.polynomial.laguerre.lagroots([0, 0, 0, 1]) / 5)
    np.testing.assert_allclose(frequencies(problem, y), expected, rtol=1e-11)


def test_other_mechanical_problems():
    problem = PROBLEMS["oscillator"](stiffness=4.0, mass=2.0)
    y = hanging_equilibrium(problem)
    np.testing.assert_allclose(y, np.zeros((2, 1, 1)), atol=1e-15)
    assert frequencies(problem, y) == pytest.approx([2**0.5])
    # z^2 + z/20 + 2 = 0.
    found = growth_per_frame(problem, "explicit-euler", 16)
    assert found.rate == pytest.approx(euler_rate(16, 2**0.5, 0.05), rel=1e-12)


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
    ],
)
def test_misuse(call, words):
    with pytest.raises(InputError, match=words):
        call()


def test_an_upright_rope_has_no_frequencies():
    # Springs of length 10 under the weight of one to three nodes: an unstable equilibrium.
    problem = small(end=(0, 30))
    y = np.zeros_like(problem.y0)
    y[0, 1] = [0, 9.97, 19.95, 29.94]
    with pytest.raises(InputError, match="y: .* given; allowed: a stable equilibrium"):
        frequencies(problem, y)


@pytest.mark.parametrize(
    ("steps", "damping"), [(16, 0.0), (1024, 0.1), (65536, 0.0), (65536, 0.01)]
)
def test_explicit_euler_grows_as_its_closed_form(steps, damping):
    expected = euler_rate(steps, OMEGA, damping)
    found = growth_per_frame(small(damping=damping), "explicit-euler", steps)
    assert abs(found.rate - expected) <= found.tolerance
    assert found.tolerance < 1e-10
    assert found.stable == (expected <= 0)
    assert found.radius == pytest.approx(np.exp(expected / steps), rel=1e-15)
    assert found.per_frame == pytest.approx(np.exp(expected), rel=1e-9)
    if expected > 0:
        assert found.frequency == pytest.approx(OMEGA[-1], rel=0.01 if steps > 16 else 0.5)
        assert found.predicted_blow_up == np.ceil(53 * np.log(2) / found.rate)
    else:
        assert found.predicted_blow_up is None


@pytest.mark.parametrize(
    ("name", "damping", "steps"),
    [
        ("semi-implicit-euler", 0.1, 65536),
        ("semi-implicit-euler", 0.0, 16),
        ("stormer-verlet", 0.0, 16),
        ("stormer-verlet", 0.0, 65536),
        ("velocity-verlet", 0.0, 16),
    ],
)
def test_symplectic_steppers_decay_by_the_damping_alone(name, damping, steps):
    # mu^2 - (2 - r dt - (omega dt)^2) mu + 1 - r dt = 0: complex roots have |mu|^2 = 1 - r dt.
    found = growth_per_frame(small(damping=damping), name, steps)
    assert found.stable
    assert found.rate == pytest.approx(steps * np.log1p(-damping / steps) / 2, abs=found.tolerance)
    # A few roundings in each step; where the velocity is a difference of positions, a rounding
    # of these moves it by n of them.
    each_step = 5e-15 * (steps if name == "stormer-verlet" else 1)
    assert found.tolerance < 1e-13 + each_step * steps
    assert found.predicted_blow_up is None


def test_parts_of_a_rope_may_be_damped_unequally():
    # The eigenvalues of the flow itself, which a step of a ten-thousandth follows.
    damping = (0.0, 0.3, 0.0, 0.1)
    flows = [
        np.block([[np.zeros((3, 3)), np.eye(3)], [-each, -np.diag(damping[1:])]])
        for each in stiffness_matrices(*OF_SMALL)
    ]
    slowest = max(np.max(np.linalg.eigvals(flow).real) for flow in flows)
    found = growth_per_frame(small(damping=damping), "rk4", 256)
    assert found.rate == pytest.approx(slowest, rel=1e-6)


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
    started = dataclasses.replace(problem, y0=y + disturbance, ts=np.arange(frames + 1.0))
    run = simulate(started, name, steps)
    assert run.status == "ok"
    size = np.linalg.norm(
        [predicted.frequency * (run.states - y)[:, 0, 1], run.states[:, 1, 1]], axis=(0, 2)
    )
    later = np.arange(frames // 2, frames + 1)
    slope = np.polyfit(later, np.log(size[later]), 1)[0]
    assert slope == pytest.approx(predicted.rate, rel=0.01)


@pytest.mark.slow
def test_a_projection_of_lengths_damps_as_predicted():
    # Released a thousandth of a radian from hanging. Faster modes are gone in the second half;
    # 0.75 decay times with 7 swings in them give the slope to a percent.
    problem = InextensibleRope(**SMALL, damping=0.0).problem(600)
    predicted = growth_per_frame(problem, "constraint-verlet", 4)
    assert -0.01 < predicted.rate < -0.001
    below = -hanging_equilibrium(problem)[0, 1]
    start = problem.y0.copy()
    start[0] = [below * np.sin(1e-3), -below * np.cos(1e-3)]
    run = simulate(dataclasses.replace(problem, y0=start), "constraint-verlet", 4)
    aside, speed = run.positions[300:, :, 0].mean(axis=1), run.velocities[300:, :, 0].mean(axis=1)
    size = np.hypot(predicted.frequency * aside, speed)
    slope = np.polyfit(run.times[300:], np.log(size), 1)[0]
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
def test_limits_of_a_hanging_rope(stepper, damping, limit):
    found = stability_limit(small(damping=damping), stepper)
    assert found == (limit and np.ceil(limit))


def test_the_limit_at_another_state():
    # The straight rope at rest: docs/explanation/stability.md has its frequencies.
    problem = small()
    omega = 20 * np.sin(5 * np.pi / 14)
    assert stability_limit(problem, "explicit-euler", problem.y0) == np.ceil(omega**2 / 0.01)


def test_damping_per_step_grows_with_the_steps():
    # The factor 1 - c on each step is a rate of c n per frame; modes slower than it creep at
    # omega^2/(c n), the slowest of all sets the pace.
    found = growth_per_frame(small(damping=0.1), "stormer-verlet:damping=per-step", 1024)
    assert found.rate == pytest.approx(-(OMEGA[0] ** 2) / 102.4, rel=0.01)


@pytest.mark.parametrize("name", every_name("constraint-verlet"))
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


@pytest.mark.slow
# Of equinox, which differentiates the loop.
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_a_loop_that_is_differentiated_backwards_only():
    problem = PROBLEMS["oscillator"](stiffness=100.0, damping=0.5)
    found = growth_per_frame(problem, "diffrax:Heun", 20)
    assert found.rate == pytest.approx(growth_per_frame(problem, heun, 20).rate, rel=1e-9)


def test_a_step_in_numpy_at_rest_at_zero():
    """Where all numbers are zero, differences need the size of the problem."""
    problem = PROBLEMS["oscillator"](stiffness=4.0, damping=0.0)
    found = growth_per_frame(problem, euler_in_numpy, 10)
    assert found.rate == pytest.approx(euler_rate(10, 2.0, 0.0), rel=1e-9)


def test_a_method_that_starts_as_another_grows_as_it_goes_on():
    problem = PROBLEMS["oscillator"](stiffness=400.0)
    assert stability_limit(problem, Ramp) == stability_limit(problem, "adams-bashforth4")


@pytest.mark.slow
def test_a_method_that_never_settles_has_no_limit():
    with pytest.raises(InputError, match="settled"):
        stability_limit(small(), EulerAndHeunInTurns)
