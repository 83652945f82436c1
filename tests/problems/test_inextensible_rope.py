"""The inextensible rope: its equations, what they keep, its limits and its input."""

from __future__ import annotations

import jax
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ropeode.problems import InextensibleRope, Rope
from tests.problems.in_jax import in_jax

EXAMPLE = InextensibleRope(num_nodes=2).problem(1)
acceleration, constraints = EXAMPLE.mechanics.acceleration, EXAMPLE.constraints
energy_slope = jax.grad(EXAMPLE.energy, argnums=1)


def stretching(x):
    """For each link what node velocities stretch it: ``d . (v_b - v_a)``; ``x`` is ``(n, dim)``."""
    nodes, dim = x.shape
    rows = np.zeros((nodes - 1, nodes, dim))
    for i in range(nodes - 1):
        rows[i, i + 1] = x[i + 1] - x[i]
        rows[i, i] = x[i] - x[i + 1]
    return rows.reshape(nodes - 1, nodes * dim)


@st.composite
def admissible(draw):
    """Numbers and a state: any shape of the right lengths, velocities that stretch no link."""
    dim, nodes = draw(st.sampled_from([(2, 2), (2, 3), (3, 8)]))
    pins = draw(st.sampled_from([0, 1, 1, 2, 3]))
    first = draw(st.integers(0, nodes - 1))
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    free = np.ones(nodes)
    free[first : min(first + pins, first + nodes - 1)] = 0.0
    length = random.uniform(0.3, 3, nodes - 1)
    direction = random.normal(size=(nodes - 1, dim))
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    x = random.normal(size=dim) + np.vstack(
        [np.zeros(dim), np.cumsum(length[:, None] * direction, axis=0)]
    )
    # The nearest velocities of the free nodes that stretch no link.
    v = (random.normal(size=(nodes, dim)) * free[:, None]).ravel()
    rows = stretching(x) * np.repeat(free, dim)
    v = (v - np.linalg.pinv(rows) @ (rows @ v)).reshape(nodes, dim)
    args = EXAMPLE.args._replace(
        mass=random.uniform(0.2, 5, nodes),
        rest_length=length,
        free=free,
        gravity=random.normal(size=(dim, 1)),
        damping=random.uniform(0, 3, nodes),
    )
    return args, x.T, v.T


def dense_solution(args, x, v):
    """``M a - J^T tensions = f`` and ``J a = -J' v`` as one system of the free nodes."""
    dim, nodes = x.shape
    moves = np.repeat(args.free, dim) > 0
    links = (args.free[1:] + args.free[:-1]) > 0
    rows = stretching(x.T)[links][:, moves]
    w = np.diff(v)[:, links]
    force = (args.mass * args.gravity - args.damping * v).T.ravel()[moves]
    count, size = rows.shape
    system = np.zeros((size + count, size + count))
    system[:size, :size] = np.diag(np.repeat(args.mass, dim)[moves])
    system[:size, size:] = -rows.T
    system[size:, :size] = rows
    found = np.linalg.solve(system, np.concatenate([force, -np.sum(w * w, axis=0)]))
    result = np.zeros(nodes * dim)
    result[moves] = found[:size]
    return result.reshape(nodes, dim).T


@settings(deadline=None, max_examples=60)
@given(case=admissible(), t=st.floats(0, 3))
def test_it_moves_by_a_dense_solve_with_forces_that_do_no_work(case, t):
    """And its constraints are zero where they hold, and lengths and rates where they do not."""
    args, x, v = case
    found = in_jax(acceleration, t, x, v, args)
    expected = dense_solution(args, x, v)
    size = np.max(np.abs(expected))
    # Masses and lengths differ by factors of up to 25 and 10: systems that lose some digits.
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-11 * size)
    assert not np.any(found[:, args.free == 0])

    power = in_jax(energy_slope, t, np.stack([x, v]), args) * np.stack([v, found])
    lost = args.damping * v**2
    assert abs(np.sum(power) + np.sum(lost)) <= 1e-12 * (np.sum(np.abs(power)) + np.sum(lost))

    held = in_jax(constraints, t, np.stack([x, v]), args)
    assert set(held) == {"position", "velocity"}
    np.testing.assert_allclose(held["position"], 0, atol=1e-14 * np.max(np.abs(x)))
    np.testing.assert_allclose(held["velocity"], 0, atol=1e-12 * max(np.max(np.abs(v)), 1))
    off = in_jax(constraints, t, np.stack([1.5 * x, v + 0.25 * x]), args)
    np.testing.assert_allclose(off["position"], 0.5 * args.rest_length, rtol=1e-12)
    np.testing.assert_allclose(off["velocity"], 0.25 * args.rest_length, rtol=1e-10)


@pytest.mark.parametrize("kind", [Rope, InextensibleRope])
def test_one_node_without_pins_is_accelerated_by_gravity_and_damping(kind):
    rope = kind(num_nodes=1, pinned=(), node_mass=2.0, damping=0.5, gravity=(0.25, -1.0))
    problem, v = rope.problem(), np.array([[1.0], [3.0]])
    found = problem.rhs(0.0, np.stack([problem.y0[0], v]), problem.args)
    np.testing.assert_array_equal(found, [v, np.array([[0.25], [-1.0]]) - 0.25 * v])
    assert problem.drift(problem.y0[None]).keys() == (
        {"position", "velocity"} if kind is InextensibleRope else set()
    )


def test_velocities_that_only_rounding_makes_stretch_are_taken():
    start, along = np.array([1000.1, 2000.3]), np.array([-3.7, -1.2])
    across = np.outer(range(16), [1.2, -3.7])
    rope = InextensibleRope(start=start, end=start + along, num_nodes=16, initial_velocity=across)
    assert np.all(rope.problem().y0[1, :, 1:] != 0)
    # Nodes that fly alike, and pins that only the velocity of all free nodes spares.
    assert InextensibleRope(pinned=(), initial_velocity=(3, 4)).problem().rigid
    assert InextensibleRope(initial_velocity=(0, 4)).problem().y0[1, 1].tolist() == [0] + [4] * 15
