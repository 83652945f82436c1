"""Spec files."""

from __future__ import annotations

import datetime
import itertools
import tomllib

import pytest

from ropeode import Rope
from ropeode.errors import InputError, UserCodeError
from ropeode.problems import PROBLEMS, ROPES
from ropeode.study import (
    DEFAULT_STEPS_PER_FRAME,
    TableJob,
    TableSpec,
    commented_table,
    default_steppers,
    read_spec,
)


def test_the_commented_spec_holds_the_defaults():
    text = commented_table()
    values = tomllib.loads(text)
    assert Rope(**values["rope"]) == Rope()
    assert set(values["rope"]) == set(Rope.model_fields)
    job = TableJob(values)
    labels = [each.label for each in job.spec.steppers]
    assert labels == default_steppers(Rope().problem())
    assert job.spec.kind == TableSpec().kind == values["kind"] == "rope"
    assert all(kind in text for kind in ROPES)
    assert job.spec.steps_per_frame == DEFAULT_STEPS_PER_FRAME
    assert job.problem.parameters == TableJob({}).problem.parameters
    for name in TableSpec.model_fields:
        assert f"{name} = " in text


def test_all_faults_of_a_file_at_once():
    values = {
        "frame": 3,
        "steppers": ["rk5"],
        "steps_per_frame": [0],
        "rope": {"damping": -1, "nodes": 3, "stiffness": "x"},
    }
    with pytest.raises(InputError) as caught:
        TableJob(values)
    text = "\n".join(caught.value.problems)
    assert len(caught.value.problems) == 6
    for word in ("frame", "rk5", "steps_per_frame", "damping", "nodes", "stiffness"):
        assert word in text


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"rope": 3}, "rope: 3 given; allowed: a table"),
        ({"problem": "kepler", "rope": {"damping": 0.1}}, "rope: .* leave out one"),
        ({"problem": "keplre"}, "did you mean 'kepler'"),
        ({"problem": 3}, "problem: 3 given"),
        ({"problem": {"kind": "rope"}}, "problem: {'kind': 'rope'} given; .* problem = \"rope\""),
        ({"kind": "chain"}, "kind: 'chain' given, which does not exist; allowed: rope, inext"),
        ({"kind": "inextensible"}, "did you mean 'inextensible-rope'"),
        ({"kind": 3}, "kind: 3 given"),
        ({"problem": "kepler", "kind": "inextensible-rope"}, "kind: .* leave out one"),
        (
            {"kind": "inextensible-rope", "rope": {"stiffness": 100.0}},
            "stiffness: 100.0 given; allowed: none with kind 'inextensible-rope'",
        ),
        (
            {"problem": "inextensible-rope", "rope": {"stiffness": 100.0}},
            "stiffness: 100.0 given; allowed: none with kind 'inextensible-rope'",
        ),
        (
            {"kind": "inextensible-rope", "rope": {"num_nodes": 4, "pinned": [0, 3]}},
            r"pinned: \[0, 3\] given; allowed: one node, or neighbours",
        ),
        ({"frames": "x"}, "frames: 'x' given"),
        ({"rtol": 0}, "rtol: 0 given"),
        ({"norm": "positions"}, "did you mean 'position-"),
    ],
    ids=str,
)
def test_bad_values(values, words):
    with pytest.raises(InputError, match=words):
        TableJob(values)


# What TOML can hold, and a few texts that no file can be named.
OF_ALL_TYPES = (
    *({}, {"kind": "rope"}, [], [{}], [[1]], [[[1.0]]], ["a"], [{"a": 1}]),
    *(0, -1, 3, 10**400, 1.5, float("nan"), float("inf"), True),
    *("", "x", "nan", "a\0.py:x", "x" * 5000, datetime.date(2026, 1, 1), datetime.time(1, 2)),
)


@pytest.mark.parametrize("beside", [{}, {"problem": "kepler"}, {"kind": "inextensible-rope"}])
def test_values_of_all_types_in_all_fields(beside):
    """Each is taken, or refused by name; no other exception."""
    fields = [(name, None) for name in (*TableSpec.model_fields, "rope", "")]
    for (name, within), value in itertools.product(
        fields + [("rope", each) for each in Rope.model_fields], OF_ALL_TYPES
    ):
        spec = {**beside, name: value if within is None else {within: value}}
        faults: tuple[str, ...] = ()
        try:
            TableJob(spec)
        except InputError as error:
            faults = error.problems
        assert all("Fix: " in line for line in faults), spec


def test_library_problems_by_name():
    job = TableJob({"problem": "kepler", "frames": 7})
    assert job.problem.name == "Kepler"
    assert job.problem.frames == 7


@pytest.mark.parametrize("kind", ROPES)
def test_ropes_by_kind_or_by_name(kind):
    rope = {"num_nodes": 5, "damping": 0.3}
    by_kind = TableJob({"kind": kind, "frames": 4, "rope": rope})
    by_name = TableJob({"problem": kind, "frames": 4, "rope": rope})
    expected = PROBLEMS[kind](frames=4, **rope).parameters
    assert by_kind.problem.parameters == by_name.problem.parameters == expected
    assert expected["kind"] == kind
    # A kind that is said overrules the name, and nothing else does.
    again = TableJob({"problem": "rope", "kind": kind, "frames": 4, "rope": rope})
    assert again.problem.parameters == expected
    assert TableJob({"problem": kind}).problem.parameters == PROBLEMS[kind]().parameters


def test_bad_files(tmp_path):
    path = tmp_path / "spec.toml"
    path.write_text("frames = = 3")
    with pytest.raises(InputError, match=r"spec: .* a TOML file \(.*line 1"):
        read_spec(path)
    with pytest.raises(InputError, match=r"spec: .*\(No such file"):
        read_spec(tmp_path / "missing.toml")


USER_FILE = """
import jax.numpy as jnp
import numpy as np
from ropeode import Problem, Rope

fixed = Problem(lambda t, y, args: -y, [1.0], [0.0, 1.0, 2.0], name="fixed")
rope = Rope(num_nodes=3)

def made(frames=4):
    return Problem(lambda t, y, args: -y, [1.0], np.arange(frames + 1.0))

def wrong_shape():
    return Problem(lambda t, y, args: jnp.ones(3), [1.0], [0.0, 1.0])

def raises():
    return Problem(lambda t, y, args: y["x"], [1.0], [0.0, 1.0])

def fails():
    raise RuntimeError("no such file of mine")

three = 3
"""


@pytest.fixture
def user_file(tmp_path):
    (tmp_path / "mine.py").write_text(USER_FILE)
    return tmp_path


def test_problems_of_users(user_file):
    def load(name, **more):
        return TableJob({"problem": f"mine.py:{name}", **more}, folder=user_file).problem

    assert load("fixed").name == "fixed"
    assert load("made").frames == 4
    assert load("made", frames=9).frames == 9
    assert load("rope", frames=5).frames == 5
    for name, words in [
        ("three", "this is a int"),
        ("fxied", "did you mean 'fixed'"),
        ("wrong_shape", r"rhs result: \(3,\) given"),
    ]:
        with pytest.raises(InputError, match=words):
            load(name)
    for name in ("raises", "fails"):
        with pytest.raises(UserCodeError) as caught:
            load(name)
        assert caught.value.__cause__ is not None
    with pytest.raises(InputError, match="frames: 3 given; .* sample times are fixed"):
        load("fixed", frames=3)
    with pytest.raises(InputError, match="FILE.py:NAME"):
        TableJob({"problem": "mine.py"}, folder=user_file)
    with pytest.raises(InputError, match="No such file"):
        TableJob({"problem": "yours.py:x"}, folder=user_file)
