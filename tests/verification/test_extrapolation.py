"""The truth in extended precision, held against solutions that are known."""

from __future__ import annotations

import numpy as np
import pytest

from ropeode.problems import InextensibleRope, Rope
from tests.verification.extrapolation import (
    EPS,
    Links,
    inextensible_rope_solution,
    integrate,
    rope_rhs,
    rope_sizes,
    rope_solution,
    solve_symmetric,
)

pytestmark = pytest.mark.skipif(EPS > 2e-19, reason="np.longdouble is no wider than float64 here")
ONE = np.longdouble(1)


def oscillator(t, y):
    return np.stack([y[:, 1], -y[:, 0]], axis=1)


def test_harmonic_oscillator():
    ts = np.linspace(0, 200, 41)
    states = integrate(oscillator, [[1.0], [0.0]], ts)
    assert states.dtype == np.longdouble
    exact = np.stack([np.cos(ONE * ts), -np.sin(ONE * ts)], axis=1)[..., None]
    # 32 periods; float64 solvers make errors of 1e-13 here.
    assert np.max(np.abs(states - exact)) < 7e-17


def test_time_dependent_right_hand_side():
    ts = np.array([0.5, 0.6, 2.0, 7.3])
    states = integrate(lambda t, y: -3 * (y - np.cos(2 * t)), [[1.0, 2.0]], ts)
    late = ONE * ts - ts[0]

    def settled(t):
        return 3 * (3 * np.cos(2 * t) + 2 * np.sin(2 * t)) / 13

    start = settled(ONE * ts[0])
    exact = settled(ONE * ts)[:, None, None] + np.exp(-3 * late)[:, None, None] * (
        np.array([[1.0, 2.0]]) - start
    )
    assert np.max(np.abs(states - exact)) < 3e-18


def test_nonlinear_growth_keeps_its_relative_accuracy():
    ts = np.linspace(0, 0.99, 5)
    states = integrate(lambda t, y: y * y, [1.0], ts)
    exact = 1 / (1 - ONE * ts)
    # Near the pole at t = 1 an error in the state grows with the square of the state.
    assert np.max(np.abs(states[:, 0] / exact - 1) / exact) < 3e-18


def test_stops_at_a_pole():
    with pytest.raises(ArithmeticError, match="no step"):
        integrate(lambda t, y: y * y, [1.0], [0.0, 1.5])


def test_tolerance_is_what_the_error_follows():
    ts = np.linspace(0, 10, 3)
    errors = [
        float(np.max(np.abs(integrate(oscillator, [[1.0], [0.0]], ts, rtol=rtol)[-1, 0] - exact)))
        for exact in [np.cos(10 * ONE)]
        for rtol in (1e-6, 1e-9, 1e-12)
    ]
    assert errors[0] > 10 * errors[1] > 100 * errors[2]
    assert errors[0] < 1e-6


@pytest.mark.parametrize("dim", [2, 3])
def test_rope_of_two_nodes_along_gravity(dim):
    """A mass on a spring that hangs from a pin: a harmonic oscillator about its lower rest."""
    end = (0.0,) * (dim - 1) + (-4.0,)
    gravity = (0.0,) * (dim - 1) + (-1.0,)
    problem = Rope(
        start=(0.0,) * dim,
        end=end,
        num_nodes=2,
        node_mass=(1.0, 2.0),
        stiffness=18.0,
        gravity=gravity,
        damping=0.0,
    ).problem(frames=10)
    states = rope_solution(problem)
    # omega^2 = k/m = 9; the spring hangs lower by m g/k = 1/9.
    exact = -4 - (1 - np.cos(3 * ONE * problem.ts)) / 9
    assert np.max(np.abs(states[:, 0, -1, 1] - exact)) < 2e-17
    assert np.max(np.abs(states[:, 1, -1, 1] + np.sin(3 * ONE * problem.ts) / 3)) < 1e-16
    assert not np.any(states[:, :, :, 0])


def test_rope_keeps_its_energy_and_momentum():
    """Unequal masses, springs and velocities, no pins: nothing of the equations is left out."""
    rope = Rope(
        start=(1.0, 2.0, 3.0),
        end=(5.0, 1.0, 0.0),
        num_nodes=5,
        node_mass=(1.0, 2.0, 0.5, 3.0, 0.25),
        stiffness=(10.0, 20.0, 30.0, 5.0),
        pinned=(),
        damping=0.0,
        initial_velocity=((1, 0, 0), (0, -2, 0), (0, 0, 1), (1, 1, 1), (0, -1, 3)),
    )
    problem = rope.problem(frames=5)
    x, v = np.moveaxis(rope_solution(problem), 1, 0)
    args = problem.args
    length = np.sqrt(np.sum(np.diff(x) ** 2, axis=1))
    energy = (
        0.5 * np.sum(args.mass * v**2, axis=(1, 2))
        + 0.5 * np.sum(args.stiffness * (length - args.rest_length) ** 2, axis=1)
        - np.sum(args.mass * args.gravity * x, axis=(1, 2))
    )
    assert np.max(np.abs(energy - energy[0])) < 1e-16 * np.abs(energy[0])
    momentum = np.sum(args.mass * v, axis=2)
    fallen = np.sum(args.mass) * args.gravity[:, 0] * problem.ts[:, None]
    np.testing.assert_allclose((momentum - momentum[0] - fallen).astype(np.float64), 0, atol=1e-15)


def test_rope_damping_takes_momentum():
    """Without pins and gravity, equal damping per mass stops the centre of mass exponentially."""
    problem = Rope(
        num_nodes=4,
        pinned=(),
        gravity=(0, 0),
        node_mass=(1.0, 2.0, 4.0, 1.0),
        damping=(0.5, 1.0, 2.0, 0.5),
        initial_velocity=((3, 1), (0, 0), (-1, 2), (0, 5)),
    ).problem(frames=4)
    momentum = np.sum(problem.args.mass * rope_solution(problem)[:, 1], axis=2)
    expected = momentum[0] * np.exp(-problem.ts / 2 * ONE)[:, None]
    assert np.max(np.abs(momentum - expected)) < 1e-15


def test_pins_hold_and_two_tolerances_agree():
    problem = Rope(num_nodes=6, pinned=(0, 3), stiffness=50.0).problem(frames=10)
    states = rope_solution(problem)
    assert np.array_equal(states[-1, 0][:, [0, 3]], problem.y0[0][:, [0, 3]])
    assert not np.any(states[:, 1][:, :, [0, 3]])
    again = rope_solution(problem, rtol=3e-20)
    sizes = rope_sizes(problem.args, problem.y0)
    assert np.max(np.abs(states - again) / sizes) < 2e-17


def test_rhs_takes_many_states_at_once():
    problem = Rope(num_nodes=4).problem(frames=1)
    rhs = rope_rhs(problem.args)
    y = problem.y0 + np.random.default_rng(0).normal(size=(3, *problem.y0.shape))
    together = rhs(np.zeros((3, 1, 1, 1)), y)
    for i in range(3):
        assert np.array_equal(together[i], rhs(np.zeros((1, 1, 1, 1)), y[i : i + 1])[0])


def double_pendulum(mass, length, damping):
    """The textbook's equations in the angles from the vertical, with damping on each bob."""
    (m1, m2), (l1, l2), (c1, c2) = mass, length, damping

    def rhs(t, y):
        (a, b), (p, q) = np.moveaxis(y[:, 0], -1, 0), np.moveaxis(y[:, 1], -1, 0)
        c, s = np.cos(a - b), np.sin(a - b)
        m11, m12, m22 = (m1 + m2) * l1**2, m2 * l1 * l2 * c, m2 * l2**2
        f1 = -m2 * l1 * l2 * s * q**2 - (m1 + m2) * l1 * np.sin(a)
        f2 = m2 * l1 * l2 * s * p**2 - m2 * l2 * np.sin(b)
        # Rayleigh's dissipation c v^2/2 of each bob.
        f1 = f1 - (c1 + c2) * l1**2 * p - c2 * l1 * l2 * c * q
        f2 = f2 - c2 * l2**2 * q - c2 * l1 * l2 * c * p
        det = m11 * m22 - m12 * m12
        change = np.stack([(m22 * f1 - m12 * f2) / det, (m11 * f2 - m12 * f1) / det], axis=-1)
        return np.stack([y[:, 1], change], axis=1)

    return rhs


@pytest.mark.parametrize("damping", [(0.0, 0.0), (0.1, 0.3)])
def test_inextensible_rope_of_three_nodes_is_the_double_pendulum(damping):
    problem = InextensibleRope(
        start=(0, 0),
        end=(4, 0),
        num_nodes=3,
        node_mass=(1, 2, 0.5),
        damping=(0, *damping),
        initial_velocity=((0, 0), (0, 1), (0, -0.5)),
    ).problem(frames=5)
    states = inextensible_rope_solution(problem)
    length = ONE * np.array([2, 2])
    # Along x; the rates are those of the links, over their lengths.
    angles = integrate(
        double_pendulum(ONE * np.array([2, 0.5]), length, ONE * np.array(damping)),
        np.array([[np.arccos(0 * ONE)] * 2, [0.5, -0.75]]),
        problem.ts,
    )
    bobs = np.cumsum(length * np.stack([np.sin(angles[:, 0]), -np.cos(angles[:, 0])], 1), axis=2)
    # Both are good to some 1e-18 a step; a factor of a hundred is left for its growth.
    assert np.max(np.abs(states[:, 0, :, 1:] - bobs)) < 1e-16
    assert not np.any(states[:, :, :, 0])


@pytest.mark.slow
def test_inextensible_rope_without_pins_keeps_what_it_must():
    problem = InextensibleRope(
        start=(1, 2, 3),
        end=(4, 2, 3),
        num_nodes=5,
        node_mass=(1, 2, 0.5, 3, 0.25),
        pinned=(),
        damping=0.0,
        initial_velocity=((1, 0, 0), (1, -2, 0), (1, 0, 1), (1, 1, 1), (1, -1, 3)),
    ).problem(frames=4)
    links = Links(problem)
    x, v = np.moveaxis(inextensible_rope_solution(problem), 1, 0)
    np.testing.assert_allclose((x[0] - problem.y0[0]).astype(np.float64), 0, atol=1e-18)
    length = np.sqrt(np.sum(np.diff(x) ** 2, axis=1))
    assert np.max(np.abs(length - links.length)) < 1e-16
    rates = np.sum(np.diff(x) * np.diff(v), axis=1)
    assert np.max(np.abs(rates)) < 3e-16
    args = problem.args
    energy = 0.5 * np.sum(args.mass * v**2, axis=(1, 2)) - np.sum(
        args.mass * args.gravity * x, axis=(1, 2)
    )
    assert np.max(np.abs(energy - energy[0])) < 1e-16 * np.abs(energy[0])
    momentum = np.sum(args.mass * v, axis=2)
    fallen = np.sum(args.mass) * args.gravity[:, 0] * problem.ts[:, None]
    assert np.max(np.abs(momentum - momentum[0] - fallen)) < 1e-16
    spin = np.sum(args.mass * np.cross(x, v, axis=1), axis=2)
    centre = np.sum(args.mass * x, axis=2)
    gravity = np.broadcast_to(args.gravity[:, 0], centre.shape)
    # Gravity's torque is that on the centre of mass, which flies along a parabola.
    flight = problem.ts[:, None] * momentum[0] + fallen * problem.ts[:, None] / 2
    start = centre[0] / np.sum(args.mass)
    moved = flight / np.sum(args.mass)
    torque = np.cross(start, fallen) + np.cross(momentum[0] / 2 * problem.ts[:, None] ** 2, gravity)
    np.testing.assert_allclose(
        (centre / np.sum(args.mass) - start - moved).astype(float), 0, atol=1e-16
    )
    assert np.max(np.abs(spin - spin[0] - torque)) < 1e-15


@pytest.mark.slow
def test_two_tolerances_agree_on_inextensible_ropes():
    problem = InextensibleRope(
        num_nodes=6, pinned=(1, 2), start=(0, 0, 0), end=(10, 0, 0), damping=0.2
    ).problem(frames=5)
    states = inextensible_rope_solution(problem)
    again = inextensible_rope_solution(problem, rtol=3e-20)
    assert np.max(np.abs(states - again)) < 1e-16
    assert np.array_equal(states[-1, 0][:, [1, 2]], problem.y0[0][:, [1, 2]])
    assert not np.any(states[:, 1][:, :, [1, 2]])


def test_symmetric_systems_are_solved_in_extended_precision():
    random = np.random.default_rng(5)
    root = random.normal(size=(3, 7, 7)).astype(np.longdouble)
    system = root @ np.swapaxes(root, 1, 2) + np.eye(7)
    solution = random.normal(size=(3, 7)).astype(np.longdouble)
    found = solve_symmetric(system, (system @ solution[..., None])[..., 0])
    condition = float(np.max(np.linalg.cond(system.astype(np.float64))))
    assert np.max(np.abs(found - solution)) < 20 * EPS * condition
