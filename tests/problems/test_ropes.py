"""Ropes: their equations, what these keep, their parameters, and what is made of them."""

from __future__ import annotations

import types

import jax
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ropeode.errors import InputError
from ropeode.problems import InextensibleRope, Rope, rope
from tests.links import stretching
from tests.problems.in_jax import in_jax
from tests.problems.test_library import made_again


def functions_of(rope):
    """The functions of such ropes, of which each is compiled once for all shapes alike."""
    problem = rope.problem(frames=1)
    return types.SimpleNamespace(
        args=problem.args,
        acceleration=problem.mechanics.acceleration,
        constraints=problem.constraints,
        energy=problem.energy,
        slope=jax.grad(problem.energy, argnums=1),
    )


SPRINGS, RIGID = functions_of(Rope(num_nodes=3)), functions_of(InextensibleRope(num_nodes=2))


def test_defaults_are_the_assignment():
    problem = Rope().problem(frames=20)
    x = problem.positions(problem.y0[None])[0]
    np.testing.assert_allclose(x, np.stack([np.linspace(0, -400, 16), np.full(16, 200.0)], axis=1))
    assert problem.ts.tolist() == list(range(21))
    np.testing.assert_allclose(problem.args.rest_length, 400 / 15)
    assert np.all(problem.args.mass == 1)
    assert np.all(problem.args.stiffness == 100)
    assert problem.args.free.tolist() == [0.0] + [1.0] * 15
    assert np.all(problem.args.damping == 0.01)
    assert problem.args.gravity.ravel().tolist() == [0.0, -1.0]
    assert problem.quantities == ("position", "velocity")


def test_what_is_left_out_follows_from_the_rest():
    assert Rope((0, 0, 0), (1, 2, 3)).gravity == (0.0, -1.0, 0.0)
    # A rope of one node needs no end.
    alone = Rope(start=(1, 1), end=(1, 1), num_nodes=1, pinned=()).problem(frames=1)
    assert alone.positions(alone.y0[None]).tolist() == [[[1.0, 1.0]]]
    # A velocity of all free nodes leaves pins still.
    problem = Rope(num_nodes=3, initial_velocity=(1, 2)).problem(frames=1)
    assert problem.velocities(problem.y0[None])[0].tolist() == [[0, 0], [1, 2], [1, 2]]


STRETCHES = r"stretch no link \(link 0, between the nodes 0 and 1, .* by 3 per frame\)"


@pytest.mark.parametrize(
    ("kind", "given_", "words"),
    [
        (Rope, {"start": (0, np.inf)}, "start: "),
        (Rope, {"end": (1, 2, 3)}, "end: "),
        (Rope, {"end": (0, 200)}, "end: .* another point than start"),
        (Rope, {"node_mass": [1] * 15 + [0]}, "node_mass: "),
        (InextensibleRope, {"node_mass": [1, 2]}, "node_mass: .*16 needed, 2 given"),
        (Rope, {"stiffness": [1] * 16}, "stiffness: "),
        (Rope, {"stiffness": 10**400}, "stiffness: "),
        (Rope, {"pinned": (16,)}, "pinned: "),
        (Rope, {"pinned": (0, 0)}, "pinned: "),
        (Rope, {"gravity": (0, 0, -1)}, "gravity: "),
        (Rope, {"damping": True}, "damping: "),
        (Rope, {"initial_velocity": [(1, 2)] * 16}, "initial_velocity: "),
        (Rope, {"initial_velocity": [(1, 2), (1,)]}, "initial_velocity: "),
        (InextensibleRope, {"stiffness": 100.0}, "field: 'stiffness' given, which does not exist"),
        (InextensibleRope, {"pinned": [*range(16)]}, "pins that leave a node free .*leave one out"),
        (InextensibleRope, {"pinned": (3, 5)}, r"taut between the pins 3 and 5.* pinned = \[3\]"),
        (InextensibleRope, {"start": (1e17, 0), "end": (1e17 + 64, 0)}, "end: .* length zero"),
        (InextensibleRope, {"initial_velocity": (3, 1)}, STRETCHES),
    ],
    ids=str,
)
def test_bad_parameters(kind, given_, words):
    with pytest.raises(InputError, match=words) as caught:
        kind(**given_)
    (line,) = caught.value.problems
    assert all(word in line for word in ("given", "allowed: ", "Fix: "))


# Springs.


def accelerations_node_by_node(x, v, args):
    """Newton's second law for a rope, as one writes it down; ``x`` is ``(nodes, dim)``."""
    nodes, dim = x.shape
    result = np.zeros((nodes, dim))
    for i in range(nodes):
        force = args.mass[i] * args.gravity[:, 0] - args.damping[i] * v[i]
        for spring, neighbour in ((i - 1, i - 1), (i, i + 1)):
            if 0 <= neighbour < nodes:
                length = np.linalg.norm(x[neighbour] - x[i])
                direction = (x[neighbour] - x[i]) / length
                stretch = length - args.rest_length[spring]
                force = force + args.stiffness[spring] * stretch * direction
        result[i] = force / args.mass[i] if args.free[i] else 0.0
    return result


@st.composite
def ropes_in_motion(draw):
    """A rope with its own mass, spring and damping for each node, and a state far from rest."""
    dim, nodes = draw(st.sampled_from([(2, 1), (3, 2), (2, 7)]))
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    rope = Rope(
        start=random.normal(size=dim) * 5,
        end=random.normal(size=dim) * 5,
        num_nodes=nodes,
        gravity=random.normal(size=dim),
        node_mass=random.uniform(0.1, 5, nodes),
        stiffness=random.uniform(0.1, 500, nodes - 1),
        damping=random.uniform(0, 3, nodes),
        pinned=draw(st.lists(st.integers(0, nodes - 1), unique=True)),
    )
    return rope.problem(frames=1), random.normal(size=(2, dim, nodes)) * 4


@settings(deadline=None, max_examples=20)
@given(case=ropes_in_motion())
def test_rope_obeys_newtons_second_law(case):
    """And all forces but damping, those on pinned nodes too, are the slope of its energy."""
    problem, (x, v) = case
    args = problem.args
    assert made_again(problem).parameters == problem.parameters
    expected = accelerations_node_by_node(x.T, v.T, args)
    found = in_jax(SPRINGS.acceleration, 0.0, x, v, args).T
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12 * np.max(np.abs(expected)))
    slope = in_jax(SPRINGS.slope, 0.0, np.stack([x, v]), args)
    free = args._replace(free=np.ones_like(args.free))
    force = args.mass * in_jax(SPRINGS.acceleration, 0.0, x, v, free)
    size = np.max(np.abs(slope))
    np.testing.assert_allclose(-slope[0], force + args.damping * v, rtol=1e-12, atol=1e-12 * size)
    np.testing.assert_allclose(slope[1], args.mass * v, rtol=1e-12)


@pytest.mark.parametrize("derivative", [jax.jacfwd, jax.jacrev])
@pytest.mark.parametrize("by_roots", [True, False])
def test_a_spring_of_length_zero_pulls_nowhere(derivative, by_roots, monkeypatch):
    monkeypatch.setattr(rope, "_DIVIDES_BY_ROOTS", by_roots)

    def acceleration(t, x, v, args):
        return rope.acceleration(t, x, v, args)

    args = SPRINGS.args._replace(
        mass=np.array([2.0, 3.0, 1.0]), stiffness=np.array([5.0, 7.0]),
        rest_length=np.ones(2), free=np.ones(3), gravity=np.zeros((2, 1)), damping=np.zeros(3),
    )  # fmt: skip
    x, v = np.array([[1.0, 1.0, 1.5], [0.0, 0.0, 0.0]]), np.zeros((2, 3))
    found = in_jax(acceleration, 0.0, x, v, args)
    pull = 7.0 * (0.5 - 1.0)
    np.testing.assert_allclose(found, [[0.0, pull / 3.0, -pull], [0.0] * 3], rtol=1e-15)
    jacobian = in_jax(derivative(acceleration, argnums=1), 0.0, x, v, args)
    assert np.all(np.isfinite(jacobian))
    assert np.any(jacobian[:, 1])
    slope = in_jax(derivative(SPRINGS.energy, argnums=1), 0.0, np.stack([x, v]), args)
    assert np.all(np.isfinite(slope))


# Links that keep their lengths.


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
    args = RIGID.args._replace(
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
    found = in_jax(RIGID.acceleration, t, x, v, args)
    expected = dense_solution(args, x, v)
    size = np.max(np.abs(expected))
    # Masses and lengths differ by factors of up to 25 and 10: systems that lose some digits.
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-11 * size)
    assert not np.any(found[:, args.free == 0])

    power = in_jax(RIGID.slope, t, np.stack([x, v]), args) * np.stack([v, found])
    lost = args.damping * v**2
    assert abs(np.sum(power) + np.sum(lost)) <= 1e-12 * (np.sum(np.abs(power)) + np.sum(lost))

    held = in_jax(RIGID.constraints, t, np.stack([x, v]), args)
    assert set(held) == {"position", "velocity"}
    np.testing.assert_allclose(held["position"], 0, atol=1e-14 * np.max(np.abs(x)))
    np.testing.assert_allclose(held["velocity"], 0, atol=1e-12 * max(np.max(np.abs(v)), 1))
    off = in_jax(RIGID.constraints, t, np.stack([1.5 * x, v + 0.25 * x]), args)
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
