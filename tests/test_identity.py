"""Descriptions by which programs and references are found again."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from ropeode import identity
from ropeode.identity import described
from ropeode.problems import inextensible_rope, rope
from ropeode.problems.problem import FirstOrderForm
from ropeode.steppers import RungeKutta4, StormerVerlet, as_stepper

ARRAY = np.array([1.0, 2.0])


class Derived(RungeKutta4):
    """A user's own, which computes nobody knows what."""


def test_one_description_for_one_value(small_rope):
    assert described(small_rope) == described(rope.Rope(num_nodes=4).problem(frames=3))
    assert described((1, ARRAY, RungeKutta4())) == described((1, ARRAY.copy(), RungeKutta4()))
    assert described({"b": 1, "a": 2}) == described({"a": 2, "b": 1})


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (1, 1.0),
        (1, "1"),
        (1, True),
        (0.0, -0.0),
        ((1, 2), (1, (2,))),
        (("a", "b"), ("a, b",)),
        ({"a": 1}, {"a": 2}),
        (ARRAY, np.nextafter(ARRAY, 3.0)),
        (ARRAY, ARRAY.astype(int)),
        (ARRAY, ARRAY[:, None]),
        (StormerVerlet(), StormerVerlet(start="rest")),
        (FirstOrderForm(rope.acceleration), FirstOrderForm(inextensible_rope.acceleration)),
        (rope.acceleration, rope.Rope),
    ],
)
def test_another_for_another_value(one, other):
    assert described(one) != described(other)


def test_every_number_of_a_problem_counts(small_rope):
    found = {described(small_rope)}
    for change in (
        {"y0": np.nextafter(small_rope.y0, 1e9)},
        {"ts": small_rope.ts * 2.0},
        {"args": small_rope.args._replace(gravity=small_rope.args.gravity * 2.0)},
        {"jump_times": (0.5,)},
        {"name": "another"},
        {"mechanics": dataclasses.replace(small_rope.mechanics, in_turn=False)},
    ):
        found.add(described(small_rope.changed(**change)))
    assert len(found) == 7


@pytest.mark.parametrize(
    "value",
    [
        lambda t, y, args: -y,
        np.sin,
        Derived(),
        Derived,
        as_stepper(lambda rhs, t, y, dt, args: y),
        FirstOrderForm(lambda t, x, v, args: -x),
        np.array([ARRAY, None], dtype=object),
        object(),
        {1, 2},
    ],
)
def test_what_is_the_users_has_none(value):
    with pytest.raises(TypeError):
        described((1, value))


def test_a_function_in_place_of_one_of_ropeodes_has_none(monkeypatch):
    own = rope.acceleration
    monkeypatch.setattr(rope, "acceleration", lambda t, x, v, args: -x)
    for function in (own, rope.acceleration):
        with pytest.raises(TypeError):
            described(function)


def test_the_software_is_packages_sources_and_settings_of_jax(monkeypatch):
    identity.software.cache_clear()
    before = identity.software()
    found = {before}
    for name, other in (
        ("_version", lambda package: "0.0"),
        ("source_digest", lambda package: "another"),
        ("_processor", lambda: ["another"]),
    ):
        with monkeypatch.context() as patch:
            patch.setattr(identity, name, other)
            identity.software.cache_clear()
            found.add(identity.software())
    for variable in ("XLA_FLAGS", "JAX_DEFAULT_MATMUL_PRECISION", "EQX_ON_ERROR"):
        with monkeypatch.context() as patch:
            patch.setenv(variable, "--another")
            identity.software.cache_clear()
            found.add(identity.software())
    assert len(found) == 7
    identity.software.cache_clear()
    assert identity.software() == before
