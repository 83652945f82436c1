"""The problems that come with the package: their names and parameters, and the rope's forces."""

from __future__ import annotations

import inspect

import jax
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ropeode.errors import InputError
from ropeode.problems import PROBLEMS, ROPES, Rope
from tests.problems.in_jax import in_jax

# What a parameter of that name may not be; of any other name it may be no word.
WRONG = {
    **dict.fromkeys(("frames", "duration", "periods", "num_masses", "mass", "length"), 0),
    **dict.fromkeys(("gravity", "stiffness", "rate", "epsilon"), 0),
    "damping": -1,
    "eccentricity": 1.0,
    "masses": [1, 0],
    "lengths": 1,
    "angles": [1, 2, 3],
    "velocities": [1, float("inf")],
    "position": [1],
    "displacement": ["one"],
    "frequency": float("nan"),
    "x0": None,
    "v0": True,
    "y0": [],
}
OF_ROPES = {
    "inextensible-rope": {
        "num_nodes": 5,
        "start": [0, 0, 0],
        "end": [4, 0, 0],
        "pinned": [2, 1],
        "initial_velocity": [(0, 1, 0), (0, 0, 0), (0, 0, 0), (0, 2, 3), (0, 0, -1)],
    },
}


def defaults_of(name):
    parameters = inspect.signature(PROBLEMS[name]).parameters
    return {each: p.default for each, p in parameters.items() if each != "parameters"}


def without_kind(parameters):
    return {name: value for name, value in parameters.items() if name != "kind"}


def other_than(value):
    """A whole number, a number as text, or numbers in an array."""
    if isinstance(value, int):
        return value + 1
    return np.array(value) * 0.5 + 0.125 if isinstance(value, tuple) else str(value * 0.5 + 0.125)


@pytest.mark.parametrize("name", PROBLEMS)
@pytest.mark.parametrize("which", ["default", "other"])
def test_parameters_build_the_problem_anew(name, which):
    given = defaults_of(name)
    if which == "other":
        given = {each: other_than(value) for each, value in given.items()} | OF_ROPES.get(name, {})
    problem = PROBLEMS[name](**given)
    assert problem.parameters["kind"] == name
    again = PROBLEMS[name](**without_kind(problem.parameters))
    assert again.parameters == problem.parameters
    assert problem.frames == problem.parameters["frames"] == given["frames"]
    numbers = [jax.tree.leaves((each.y0, each.ts, each.args)) for each in (again, problem)]
    for one, other in zip(*numbers, strict=True):
        np.testing.assert_array_equal(one, other)
    # What was compiled for one serves the other.
    assert again.rhs == problem.rhs
    assert hash(again.rhs) == hash(problem.rhs)
    if which == "default":
        assert PROBLEMS[name]().parameters == problem.parameters


@pytest.mark.parametrize("name", PROBLEMS)
def test_every_parameter_is_documented_and_refused_when_wrong(name):
    if name in ROPES:
        documented, names = ROPES[name], [*ROPES[name].model_fields]
        wrong = {"num_nodes": 0, "damping": -1, "nonsense": 3}
    else:
        documented, names = PROBLEMS[name], [*defaults_of(name)]
        wrong = {each: WRONG.get(each, "a word") for each in names}
    assert all(f"{each}:" in inspect.getdoc(documented) for each in names)
    with pytest.raises(InputError) as fault:
        PROBLEMS[name](**wrong)
    for each, line in zip(wrong, fault.value.problems, strict=True):
        assert all(word in line for word in (each, "given", "allowed: ", "Fix: "))


def test_masses_that_are_not_named_start_at_rest():
    problem = PROBLEMS["linear-chain"](num_masses=3, displacement=[1, 2], velocity=[3])
    assert problem.y0.tolist() == [[1, 2, 0], [3, 0, 0]]
    with pytest.raises(InputError, match=r"velocity.*3 given for 2 masses"):
        PROBLEMS["linear-chain"](num_masses=2, velocity=[1, 2, 3])


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


EXAMPLE = Rope(num_nodes=3).problem(frames=1)
acceleration, energy = EXAMPLE.mechanics.acceleration, EXAMPLE.energy
energy_slope = jax.grad(energy, argnums=1)


@settings(deadline=None, max_examples=20)
@given(case=ropes_in_motion())
def test_rope_obeys_newtons_second_law(case):
    """And all forces but damping, those on pinned nodes too, are the slope of its energy."""
    problem, (x, v) = case
    args = problem.args
    # Whatever it is of, its parameters are enough to make it.
    assert PROBLEMS["rope"](**without_kind(problem.parameters)).parameters == problem.parameters
    expected = accelerations_node_by_node(x.T, v.T, args)
    found = in_jax(acceleration, 0.0, x, v, args).T
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12 * np.max(np.abs(expected)))
    slope = in_jax(energy_slope, 0.0, np.stack([x, v]), args)
    force = args.mass * in_jax(acceleration, 0.0, x, v, args._replace(free=np.ones(len(x[0]))))
    size = np.max(np.abs(slope))
    np.testing.assert_allclose(-slope[0], force + args.damping * v, rtol=1e-12, atol=1e-12 * size)
    np.testing.assert_allclose(slope[1], args.mass * v, rtol=1e-12)


@pytest.mark.parametrize("derivative", [jax.jacfwd, jax.jacrev])
def test_a_spring_of_length_zero_pulls_nowhere(derivative):
    args = EXAMPLE.args._replace(
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
    slope = in_jax(derivative(energy, argnums=1), 0.0, np.stack([x, v]), args)
    assert np.all(np.isfinite(slope))
