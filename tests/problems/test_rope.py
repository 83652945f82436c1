"""The rope's parameters, and what is made of them."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ropeode.errors import InputError
from ropeode.problems import Rope


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


def test_positional_and_array_arguments():
    rope = Rope((0, 0), (1, 0), 3, np.array([1.0, 2.0, 3.0]), jnp.array([5.0, 6.0]))
    assert rope.node_mass == (1.0, 2.0, 3.0)
    assert rope.stiffness == (5.0, 6.0)
    assert rope == Rope(
        start=[0, 0], end=[1, 0], num_nodes=3, node_mass=[1, 2, 3], stiffness=[5, 6]
    )
    with pytest.raises(InputError, match="at most 9"):
        Rope(*range(10))


def test_gravity_follows_the_dimension():
    assert Rope(start=(0, 0, 0), end=(1, 2, 3)).gravity == (0.0, -1.0, 0.0)
    assert Rope(start=(0, 0), end=(1, 2)).gravity == (0.0, -1.0)


def test_one_node_sits_at_the_start():
    problem = Rope(num_nodes=1, pinned=(), damping=0.0).problem(frames=2)
    assert problem.positions(problem.y0[None])[0].tolist() == [[0.0, 200.0]]
    assert Rope(start=(1, 1), end=(1, 1), num_nodes=1).num_nodes == 1


def test_velocity_for_all_free_nodes_leaves_pins_still():
    problem = Rope(num_nodes=3, initial_velocity=(1, 2)).problem(frames=1)
    assert problem.velocities(problem.y0[None])[0].tolist() == [[0, 0], [1, 2], [1, 2]]


@settings(deadline=None, max_examples=50)
@given(
    num_nodes=st.integers(1, 6),
    dim=st.integers(2, 3),
    data=st.data(),
)
def test_accepted_ropes_make_problems(num_nodes, dim, data):
    point = st.lists(st.floats(-10, 10), min_size=dim, max_size=dim)
    positive = st.floats(0.1, 50)
    rope = Rope(
        start=data.draw(point),
        end=[99.0] * dim,
        num_nodes=num_nodes,
        node_mass=data.draw(st.lists(positive, min_size=num_nodes, max_size=num_nodes)),
        stiffness=data.draw(positive),
        pinned=data.draw(st.lists(st.integers(0, num_nodes - 1), unique=True)),
        damping=data.draw(st.floats(0, 3)),
    )
    problem = rope.problem(frames=2)
    assert problem.y0.shape == (2, dim, num_nodes)
    assert problem.parameters["num_nodes"] == num_nodes
    again = Rope(**{k: v for k, v in problem.parameters.items() if k not in ("kind", "frames")})
    assert again == rope


@pytest.mark.parametrize(
    ("given_", "name"),
    [
        ({"start": (0,)}, "start"),
        ({"start": "ab"}, "start"),
        ({"start": (0, np.inf)}, "start"),
        ({"start": 3}, "start"),
        ({"start": (0, 0, 0, 0)}, "start"),
        ({"end": (1, 2, 3)}, "end"),
        ({"end": (0, 200)}, "end"),
        ({"num_nodes": 0}, "num_nodes"),
        ({"num_nodes": 2.5}, "num_nodes"),
        ({"num_nodes": "many"}, "num_nodes"),
        ({"num_nodes": None}, "num_nodes"),
        ({"node_mass": 0}, "node_mass"),
        ({"node_mass": -1}, "node_mass"),
        ({"node_mass": [1, 2]}, "node_mass"),
        ({"node_mass": [1] * 15 + [0]}, "node_mass"),
        ({"node_mass": {}}, "node_mass"),
        ({"stiffness": 0}, "stiffness"),
        ({"stiffness": "stiff"}, "stiffness"),
        ({"stiffness": [1] * 16}, "stiffness"),
        ({"stiffness": np.nan}, "stiffness"),
        ({"stiffness": 10**400}, "stiffness"),
        ({"pinned": (16,)}, "pinned"),
        ({"pinned": (-1,)}, "pinned"),
        ({"pinned": (0, 0)}, "pinned"),
        ({"pinned": (0.5,)}, "pinned"),
        ({"pinned": 0}, "pinned"),
        ({"gravity": (0, 0, -1)}, "gravity"),
        ({"gravity": -1}, "gravity"),
        ({"damping": -0.1}, "damping"),
        ({"damping": [0.1]}, "damping"),
        ({"damping": True}, "damping"),
        ({"initial_velocity": (1, 2, 3)}, "initial_velocity"),
        ({"initial_velocity": [(1, 2)] * 16}, "initial_velocity"),
        ({"initial_velocity": [(1, 2)] * 3}, "initial_velocity"),
        ({"initial_velocity": [(1, 2), (1,)]}, "initial_velocity"),
        ({"initial_velocity": 5}, "initial_velocity"),
        ({"node_mas": 1}, "field"),
    ],
    ids=str,
)
def test_bad_parameters(given_, name):
    with pytest.raises(InputError) as caught:
        Rope(**given_)
    (line,) = caught.value.problems
    assert line.startswith(f"{name}: ")
    assert "given" in line
    assert "allowed: " in line
    assert "Fix: " in line
    assert "\n" not in line


def test_all_faults_are_told_at_once():
    with pytest.raises(InputError) as caught:
        Rope(num_nodes=0, damping=-1, stiffness="x", mass=2)
    assert [line.split(":")[0] for line in caught.value.problems] == [
        "num_nodes",
        "stiffness",
        "damping",
        "field",
    ]


@pytest.mark.parametrize("frames", [0, -1, 1.5, "x", None])
def test_bad_frames(frames):
    with pytest.raises(InputError, match="frames: .* given; allowed: a whole number >= 1"):
        Rope().problem(frames=frames)
