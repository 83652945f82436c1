"""States that are pytrees: what the user's functions see, and what comes back."""

from __future__ import annotations

import collections
import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from ropeode import Ensemble, Problem, Stepper, reference, simulate
from ropeode.errors import InputError

State = collections.namedtuple("State", ["x", "v"])
Registered = jax.tree_util.register_dataclass(dataclasses.make_dataclass("Registered", ["x", "v"]))
TS = np.linspace(0.0, 1.0, 3)
X, V, STIFFNESS = np.array([[1.0, 0.5], [0.0, 2.0]]), np.array([[0.0, 1.0], [3.0, 0.0]]), 2.0


def springs(t, y, args):
    return {"x": y["v"], "v": -args["stiffness"] * y["x"]}


def motion(ts):
    """The exact one."""
    frequency = np.sqrt(STIFFNESS)
    c, s = np.cos(frequency * ts)[:, None, None], np.sin(frequency * ts)[:, None, None]
    return {"x": c * X + s * V / frequency, "v": c * V - s * X * frequency}


@pytest.fixture(scope="module")
def as_dict() -> Problem:
    return Problem(
        springs,
        {"x": X, "v": V.tolist()},
        TS,
        {"stiffness": STIFFNESS},
        energy=lambda t, y, args: jnp.sum(y["v"] ** 2 + args["stiffness"] * y["x"] ** 2) / 2,
        exact=motion,
    )


@pytest.mark.slow
def test_references_come_as_the_state_does(as_dict):
    truth = reference(as_dict)
    bound = truth.bound()[-1]
    assert bound < 1e-11
    for name, exact in motion(TS).items():
        assert np.max(np.abs(truth.tree[name] - exact)) <= bound
    assert np.max(np.abs(truth.states - as_dict.exact(TS))) <= bound
    energies = as_dict.energies(truth.states)
    assert np.ptp(energies) < 1e-12 * energies[0]


def in_trees(rhs, t, y, dt, args):
    k = rhs(t, y, args)
    return jax.tree.map(lambda y, k: y + dt * k, y, k)


def by_name(rhs, t, y, dt, args):
    # In NumPy, which JAX cannot trace.
    k = rhs(t, y, args)
    return {name: np.asarray(y[name]) + dt * np.asarray(k[name]) for name in y}


def with_arithmetic(rhs, t, y, dt, args):
    return y + dt * rhs(t, y, args)


class OneArray(Stepper):
    def step(self, system, t, carried, dt):
        return carried + dt * system.rhs(t, carried)


@pytest.mark.parametrize("stepper", [in_trees, by_name, with_arithmetic, OneArray])
def test_steps_see_what_the_right_hand_side_sees(as_dict, stepper):
    run = simulate(as_dict, stepper, 4)
    x, v = X, V
    for _ in range(8):
        x, v = x + 0.125 * v, v - 0.125 * STIFFNESS * x
    assert np.max(np.abs(run.tree["x"][-1] - x)) < 1e-14
    assert np.max(np.abs(run.tree["v"][-1] - v)) < 1e-14


def by_half(rhs, t, y, dt, args):
    """Of one array it would take the velocities for positions: the names come sorted."""
    x, v = y[: len(y) // 2], y[len(y) // 2 :]
    return jnp.concatenate([x + dt * v, v + dt * rhs(t, y, args)[len(x) :]])


COMES = r"y\['v'\] of shape \(2, 2\) and y\['x'\] of shape \(2, 2\)"
EULER = r"return \{'v': y\['v'\] \+ dt \* k\['v'\], 'x': y\['x'\] \+ dt \* k\['x'\]\}"


@pytest.mark.parametrize(
    ("step", "words"),
    [
        (by_half, rf"step: it raised .* {COMES}.*{EULER}"),
        (
            lambda rhs, t, y, dt, args: jnp.concatenate([y["x"], y["v"]]),
            rf"step result: 'an array of shape \(4, 2\)' given;.*{EULER}",
        ),
        (
            lambda rhs, t, y, dt, args: rhs(t, jnp.stack([y["x"], y["v"]]), args),
            r"y for rhs: 'an array of shape \(2, 2, 2\)' given; .* {'v': \(2, 2\)",
        ),
    ],
)
def test_a_step_that_takes_the_parts_wrongly_is_told_how_they_come(as_dict, step, words):
    with pytest.raises(InputError, match=words):
        simulate(as_dict, step, 4)


@pytest.mark.parametrize(
    ("state", "rhs"),
    [
        (State(1.0, [0.0, 2.0]), lambda t, y, args: State(y.x * 0, -y.v)),
        (Registered(1.0, [0.0, 2.0]), lambda t, y, args: Registered(0.0, -y.v)),
        ((np.ones(2), 3.0), lambda t, y, args: (-y[0], 1)),
        ({"a": {"b": 1, "c": None}, "d": [[1.0, 2.0]]}, lambda t, y, args: y),
    ],
)
def test_states_of_many_kinds(state, rhs):
    problem = Problem(rhs, state, TS)
    run = simulate(problem, "explicit-euler", 1)
    flat = np.concatenate([np.ravel(leaf) for leaf in jax.tree.leaves(state)])
    first = np.concatenate([np.ravel(leaf[0]) for leaf in jax.tree.leaves(run.tree)])
    assert problem.y0.tolist() == first.tolist() == flat.tolist()
    assert type(run.tree) is type(state)


def test_lists_and_tuples_of_numbers_are_arrays():
    for state in ([1.0, 2.0], (1.0, 2.0), ((1.0,), (2.0,)), [np.ones(2), np.ones(2)]):
        problem = Problem(lambda t, y, args: -y, state, TS)
        assert problem.structure is None
        assert problem.y0.shape == np.shape(state)


def test_ensembles_of_trees(as_dict):
    x = np.stack([X, 2 * X])
    varied = Ensemble.varying(as_dict, y0={"x": x, "v": np.stack([V, V])})
    for run, member, own in zip(simulate(varied, "rk4", 4), varied, x, strict=True):
        assert np.array_equal(run.tree["x"][0], own)
        alone = as_dict.changed(y0=member.y0)
        assert np.allclose(run.tree["x"], simulate(alone, "rk4", 4).tree["x"], atol=1e-14)
        assert Ensemble.of([as_dict, alone])[1].unravel(alone.y0)["x"].shape == (2, 2)
    # The same equations, with other names for their parts.
    other = Problem(
        lambda t, y, args: {"a": -args["stiffness"] * y["b"], "b": y["a"]},
        {"a": V, "b": X},
        TS,
        as_dict.args,
    )
    with pytest.raises(InputError, match="differ in their states"):
        Ensemble.of([as_dict, other])
    with pytest.raises(InputError, match=r"y0: .* given; allowed: the"):
        Ensemble.varying(as_dict, y0={"x": x})


def keeps(t, y, args):
    return y


TOO_FEW = r"rhs result: \{'x': \(\)\} given; allowed: the structure of the state, \{'v': \(\)"
TOO_SHORT = r"rhs result: \{'x': \(1,\)\} given; allowed: the shapes of the state, \{'x': \(2,\)\}"


@pytest.mark.parametrize(
    ("rhs", "state", "words"),
    [
        (keeps, {}, "y0: {} given; allowed: a pytree with arrays in it"),
        (keeps, {"x": "word"}, r"y0\['x'\]: 'word' given"),
        (keeps, State(1.0, 1j), r"y0\.v: 1j given"),
        (keeps, {"x": np.float32([0.1])}, r"y0\['x'\]: .* float64"),
        (keeps, {"x": 1.0, 2: 1.0}, "y0: .* a pytree of JAX"),
        (lambda t, y, args: {"x": y["x"]}, {"x": 1.0, "v": 2.0}, TOO_FEW),
        (lambda t, y, args: {"x": y["x"][:1]}, {"x": [1.0, 2.0]}, TOO_SHORT),
        (lambda t, y, args: {"x": 1j}, {"x": 1.0}, "rhs result: .* real"),
    ],
)
def test_what_cannot_be_used_is_refused_by_its_place(rhs, state, words):
    with pytest.raises(InputError, match=words):
        Problem(rhs, state, TS)
