"""The truth in extended precision, held against solutions that are known."""

from __future__ import annotations

import numpy as np
import pytest

from ropeode.problems import InextensibleRope, Rope
from tests.verification.extrapolation import EPS, integrate, rope_sizes, rope_solution

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
    # It stops at the pole.
    with pytest.raises(ArithmeticError, match="no step"):
        integrate(lambda t, y: y * y, [1.0], [0.0, 1.5])


# Unequal masses and velocities, no pins: nothing of the equations is left out.
LOOSE = {
    "start": (1, 2, 3), "num_nodes": 5, "node_mass": (1, 2, 0.5, 3, 0.25), "pinned": (),
    "damping": 0, "initial_velocity": ((1, 0, 0), (1, -2, 0), (1, 0, 1), (1, 1, 1), (1, -1, 3)),
}  # fmt: skip


@pytest.mark.parametrize(
    "rope",
    [
        Rope(end=(5, 1, 0), stiffness=(10, 20, 30, 5), **LOOSE),
        pytest.param(InextensibleRope(end=(4, 2, 3), **LOOSE), marks=pytest.mark.slow),
    ],
    ids=["springs", "rigid"],
)
def test_ropes_keep_what_they_must(rope):
    """Energy, momentum, angular momentum about the centre of mass; and links that are rigid."""
    problem = rope.problem(frames=4)
    args = problem.args
    x, v = np.moveaxis(rope_solution(problem), 1, 0)
    d = np.diff(x)
    length = np.sqrt(np.sum(d**2, axis=1))
    energy = np.sum(args.mass * (v**2 / 2 - args.gravity * x), axis=(1, 2))
    if hasattr(args, "stiffness"):
        energy += np.sum(args.stiffness * (length - args.rest_length) ** 2, axis=1) / 2
    else:
        assert np.max(np.abs(length - length[0])) < 1e-16
        assert np.max(np.abs(np.sum(d * np.diff(v), axis=1))) < 3e-16
    assert np.max(np.abs(energy - energy[0])) < 1e-16 * np.abs(energy[0])
    momentum = np.sum(args.mass * v, axis=2)
    fallen = np.sum(args.mass) * args.gravity[:, 0] * problem.ts[:, None]
    assert np.max(np.abs(momentum - momentum[0] - fallen)) < 1e-15
    centre, drift = (np.sum(args.mass * of, 2)[..., None] / np.sum(args.mass) for of in (x, v))
    spin = np.sum(args.mass * np.cross(x - centre, v - drift, axis=1), axis=2)
    assert np.max(np.abs(spin - spin[0])) < 1e-15


def test_rope_damping_takes_momentum():
    """Without pins and gravity, equal damping per mass stops the centre of mass exponentially."""
    damping = np.array(LOOSE["node_mass"]) / 2
    rope = Rope(end=(5, 1, 0), **{**LOOSE, "gravity": (0, 0, 0), "damping": damping})
    problem = rope.problem(frames=4)
    momentum = np.sum(problem.args.mass * rope_solution(problem)[:, 1], axis=2)
    expected = momentum[0] * np.exp(-problem.ts / 2 * ONE)[:, None]
    assert np.max(np.abs(momentum - expected)) < 1e-15


@pytest.mark.parametrize(
    "rope",
    [
        Rope(num_nodes=6, pinned=(0, 3), stiffness=50.0),
        InextensibleRope(num_nodes=6, pinned=(1, 2), start=(0, 0, 0), end=(10, 0, 0), damping=0.2),
    ],
    ids=["springs", "rigid"],
)
def test_pins_hold_and_two_tolerances_agree(rope):
    problem, pinned = rope.problem(frames=5), list(rope.pinned)
    states = rope_solution(problem)
    assert np.array_equal(states[-1, 0][:, pinned], problem.y0[0][:, pinned])
    assert not np.any(states[:, 1][:, :, pinned])
    again = rope_solution(problem, rtol=3e-20)
    assert np.max(np.abs(states - again) / rope_sizes(problem.args, problem.y0)) < 2e-17


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


def test_inextensible_rope_of_three_nodes_is_the_double_pendulum():
    damping = (0.1, 0.3)
    problem = InextensibleRope(
        start=(0, 0), end=(4, 0), num_nodes=3, node_mass=(1, 2, 0.5), damping=(0, *damping),
        initial_velocity=((0, 0), (0, 1), (0, -0.5)),
    ).problem(frames=5)  # fmt: skip
    states = rope_solution(problem)
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
