"""The problems that come with the package: their names and parameters."""

from __future__ import annotations

import inspect

import jax
import numpy as np
import pytest

from ropeode.errors import InputError
from ropeode.problems import PROBLEMS, ROPES

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


def made_again(problem):
    """The problem of the same parameters, which are enough to make it."""
    given = dict(problem.parameters)
    return PROBLEMS[given.pop("kind")](**given)


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
    again = made_again(problem)
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
