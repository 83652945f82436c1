"""The problems that come with the package: their names and parameters, and the rope's forces."""

from __future__ import annotations

import functools
import inspect

import jax
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ropeode.errors import InputError
from ropeode.problems import PROBLEMS, ROPES, Rope

WRONG = {
    "rope": {"num_nodes": 0, "damping": -1, "nonsense": 3},
    "inextensible-rope": {"num_nodes": 2.5, "gravity": (1, 2, 3), "damping": -1, "stiffness": 3},
    "oscillator": {"frames": 0, "mass": 0, "stiffness": -1, "damping": -1, "x0": "a", "v0": None},
    "linear-chain": {
        "frames": 1.5,
        "num_masses": 0,
        "mass": float("inf"),
        "stiffness": 0,
        "damping": -0.1,
        "displacement": ["one"],
        "velocity": 1.0,
    },
    "kepler": {"frames": -1, "eccentricity": 1.0, "periods": 0},
    "forced": {"frames": True, "rate": 0, "frequency": float("nan"), "y0": []},
    "pendulum": {"frames": 0, "length": 0, "gravity": -1, "angle": None, "velocity": "fast"},
    "double-pendulum": {
        "frames": 0,
        "masses": [1, 0],
        "lengths": 1,
        "gravity": 0,
        "angles": [1, 2, 3],
        "velocities": [1, float("inf")],
    },
    "henon-heiles": {"frames": 0.5, "duration": 0, "position": [1], "velocity": "xy"},
    "arenstorf": {"frames": -1, "periods": 0},
    "pleiades": {"frames": [], "duration": float("nan")},
    "van-der-pol": {"frames": 0, "duration": -1, "epsilon": 0, "x0": [], "v0": True},
    "lorenz": {
        "frames": 0,
        "duration": 0,
        "sigma": None,
        "rho": float("inf"),
        "beta": "b",
        "y0": [1, 2],
    },
    "robertson": {"frames": 0, "duration": -1},
    "hires": {"frames": 0, "duration": 0},
    "oregonator": {"frames": 1.5, "duration": "long"},
}
OTHER = {
    "rope": {"frames": 3, "num_nodes": 5, "start": [0, 0, 0], "end": [1, 2, 3], "pinned": [1, 3]},
    "inextensible-rope": {
        "frames": 3,
        "num_nodes": 5,
        "start": [0, 0, 0],
        "end": [4, 0, 0],
        "node_mass": np.arange(1, 6),
        "pinned": [2, 1],
        "initial_velocity": [(0, 1, 0), (0, 0, 0), (0, 0, 0), (0, 2, 3), (0, 0, -1)],
    },
    "oscillator": {"frames": 3, "mass": "2.5", "damping": 7, "x0": np.float32(0.5), "v0": -1},
    "linear-chain": {
        "frames": 3,
        "num_masses": 3,
        "displacement": np.arange(2),
        "velocity": (0, 1),
    },
    "kepler": {"frames": 3, "eccentricity": 0.9, "periods": 2.5},
    "forced": {"frames": 3, "rate": 50, "frequency": -2, "y0": 1},
    "pendulum": {"frames": 3, "length": "2.5", "gravity": 9.81, "angle": -1, "velocity": 7},
    "double-pendulum": {
        "frames": 3,
        "masses": (1, 2.5),
        "lengths": np.array([0.5, 2]),
        "angles": [1, -2],
        "velocities": [0, 3],
    },
    "henon-heiles": {"frames": 3, "duration": 7, "position": (0.1, 0), "velocity": [0, "0.2"]},
    "arenstorf": {"frames": 3, "periods": 2},
    "pleiades": {"frames": 3, "duration": 1},
    "van-der-pol": {"frames": 3, "duration": 1, "epsilon": 1e-6, "x0": 1, "v0": -0.5},
    "lorenz": {"frames": 3, "duration": 1, "sigma": 9, "rho": 15, "beta": 2, "y0": np.arange(3)},
    "robertson": {"frames": 3, "duration": 40},
    "hires": {"frames": 3, "duration": 5},
    "oregonator": {"frames": 3, "duration": 30},
}


@pytest.mark.parametrize("name", PROBLEMS)
@pytest.mark.parametrize("which", ["default", "other"])
def test_parameters_build_the_problem_anew(name, which):
    problem = PROBLEMS[name](**(OTHER[name] if which == "other" else {}))
    parameters = dict(problem.parameters)
    assert parameters.pop("kind") == name
    again = PROBLEMS[name](**parameters)
    assert again.parameters == problem.parameters
    default = inspect.signature(PROBLEMS[name]).parameters["frames"].default
    assert problem.frames == parameters["frames"] == (3 if which == "other" else default)
    np.testing.assert_array_equal(again.y0, problem.y0)
    np.testing.assert_array_equal(again.ts, problem.ts)
    for one, other in zip(jax.tree.leaves(again.args), jax.tree.leaves(problem.args), strict=True):
        np.testing.assert_array_equal(one, other)
    # What was compiled for one serves the other.
    assert again.rhs == problem.rhs
    assert hash(again.rhs) == hash(problem.rhs)


@pytest.mark.parametrize("name", PROBLEMS)
def test_all_faults_are_told_at_once(name):
    with pytest.raises(InputError) as fault:
        PROBLEMS[name](**WRONG[name])
    for field, line in zip(WRONG[name], fault.value.problems, strict=True):
        assert field in line
        assert "given" in line
        assert "allowed: " in line
        assert "Fix: " in line


@pytest.mark.parametrize("name", [name for name in PROBLEMS if name not in ROPES])
def test_every_parameter_is_documented_and_refused_when_wrong(name):
    parameters = list(inspect.signature(PROBLEMS[name]).parameters)
    documented = inspect.getdoc(PROBLEMS[name])
    assert set(WRONG[name]) <= set(parameters)
    assert all(f"{parameter}:" in documented for parameter in parameters)


@pytest.mark.parametrize("name", ROPES)
def test_every_parameter_of_a_rope_is_documented(name):
    assert "frames:" in inspect.getdoc(PROBLEMS[name])
    assert all(f"{field}:" in inspect.getdoc(ROPES[name]) for field in ROPES[name].model_fields)
    assert PROBLEMS[name]().parameters == ROPES[name]().problem().parameters


def test_kepler_covers_its_periods():
    problem = PROBLEMS["kepler"](frames=7, periods=3)
    np.testing.assert_allclose(np.diff(problem.ts), 6 * np.pi / 7)
    np.testing.assert_allclose(problem.exact(problem.ts)[-1], problem.y0, atol=1e-13)


def test_masses_that_are_not_named_start_at_rest():
    problem = PROBLEMS["linear-chain"](num_masses=3, displacement=[1, 2], velocity=[3])
    assert problem.y0.tolist() == [[1, 2, 0], [3, 0, 0]]


def test_more_numbers_than_masses_are_refused():
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
def ropes_in_motion(draw, **fixed):
    """A rope with its own mass, spring and damping for each node, and a state far from rest."""
    dim, nodes = draw(st.sampled_from([(2, 1), (3, 2), (2, 7)]))
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    rope = Rope(
        start=random.normal(size=dim) * 5,
        end=random.normal(size=dim) * 5,
        num_nodes=nodes,
        gravity=random.normal(size=dim),
        **{
            "node_mass": random.uniform(0.1, 5, nodes),
            "stiffness": random.uniform(0.1, 500, nodes - 1),
            "damping": random.uniform(0, 3, nodes),
            "pinned": draw(st.lists(st.integers(0, nodes - 1), unique=True)),
            **fixed,
        },
    )
    return rope.problem(frames=1), random.normal(size=(2, dim, nodes)) * 4


compiled = functools.cache(jax.jit)
EXAMPLE = Rope(num_nodes=3).problem(frames=1)
acceleration, energy = EXAMPLE.mechanics.acceleration, EXAMPLE.energy
energy_slope = jax.grad(energy, argnums=1)


def in_jax(function, *inputs):
    with jax.enable_x64(True):
        return np.asarray(compiled(function)(*inputs))


@settings(deadline=None, max_examples=20)
@given(case=ropes_in_motion())
def test_rope_obeys_newtons_second_law(case):
    problem, (x, v) = case
    expected = accelerations_node_by_node(x.T, v.T, problem.args)
    found = in_jax(acceleration, 0.0, x, v, problem.args).T
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12 * np.max(np.abs(expected)))


@settings(deadline=None, max_examples=20)
@given(case=ropes_in_motion(damping=0.0))
def test_forces_without_damping_are_the_energys_slope(case):
    problem, y = case
    args = problem.args
    slope = in_jax(energy_slope, 0.0, y, args)
    forces = args.mass * in_jax(acceleration, 0.0, *y, args._replace(free=np.ones_like(args.free)))
    size = np.max(np.abs(slope))
    np.testing.assert_allclose(-slope[0], forces, rtol=1e-12, atol=1e-12 * size)
    np.testing.assert_allclose(slope[1], args.mass * y[1], rtol=1e-12)
    # Along the solution, where pins hold, it does not change.
    moving = np.stack([y[0], y[1] * args.free])
    rates = slope * in_jax(problem.rhs, 0.0, moving, args)
    assert abs(np.sum(rates)) <= 1e-12 * np.sum(np.abs(rates))


@pytest.mark.parametrize(("dim", "derivative"), [(2, jax.jacfwd), (3, jax.jacrev)])
def test_a_spring_of_length_zero_pulls_nowhere(dim, derivative):
    args = EXAMPLE.args._replace(
        mass=np.array([2.0, 3.0, 1.0]),
        stiffness=np.array([5.0, 7.0]),
        rest_length=np.array([1.0, 1.0]),
        free=np.ones(3),
        gravity=np.zeros((dim, 1)),
        damping=np.zeros(3),
    )
    x = np.zeros((dim, 3))
    x[0] = [1.0, 1.0, 1.5]
    v = np.zeros_like(x)
    found = in_jax(acceleration, 0.0, x, v, args)
    pull = 7.0 * (0.5 - 1.0)
    np.testing.assert_allclose(found[0], [0.0, pull / 3.0, -pull], rtol=1e-15)
    assert not np.any(found[1:])
    jacobian = in_jax(derivative(acceleration, argnums=1), 0.0, x, v, args)
    assert np.all(np.isfinite(jacobian))
    assert np.any(jacobian[:, 1])
    slope = in_jax(derivative(energy, argnums=1), 0.0, np.stack([x, v]), args)
    assert np.all(np.isfinite(slope))
