"""Spec files."""

from __future__ import annotations

import datetime
import itertools
import re
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
    assert set(values["rope"]) == set(Rope.model_fields)
    job = TableJob(values)
    labels = [each.label for each in job.spec.steppers]
    assert labels == default_steppers(Rope().problem())
    assert job.spec.steps_per_frame == DEFAULT_STEPS_PER_FRAME
    assert job.problem.parameters == TableJob({}).problem.parameters
    for words in (*ROPES, *(f"{name} = " for name in TableSpec.model_fields)):
        assert words in text


RIGID = {"kind": "inextensible-rope"}


@pytest.mark.parametrize(
    "given",
    [
        ({"rope": 3}, "rope: 3 given; allowed: a table"),
        ({"problem": "kepler", "rope": {"damping": 0.1}}, "rope: .* leave out one"),
        ({"problem": {"kind": "rope"}}, "problem: {'kind': 'rope'} given; .* problem = \"rope\""),
        ({"kind": "inextensible"}, "did you mean 'inextensible-rope'"),
        ({"problem": "kepler", **RIGID}, "kind: .* leave out one"),
        ({**RIGID, "rope": {"stiffness": 100.0}}, "stiffness: 100.0 given; allowed: none with"),
        ({"problem": RIGID["kind"], "rope": {"stiffness": 9.0}}, "stiffness: 9.0 given; .* none"),
        ({**RIGID, "rope": {"num_nodes": 4, "pinned": [0, 3]}}, r"pinned: \[0, 3\] given"),
        (
            {"frame": 3, "steppers": ["rk5"], "rope": {"damping": -1, "nodes": 3}},
            *("frame", "did you mean 'rk4'", "damping", "nodes"),
        ),
    ],
    ids=str,
)
def test_bad_values_are_all_told_at_once(given):
    values, *words = given
    with pytest.raises(InputError) as caught:
        TableJob(values)
    assert len(caught.value.problems) == len(words)
    for word in words:
        assert re.search(word, "\n".join(caught.value.problems))


# What TOML can hold, and a few texts that no file can be named.
OF_ALL_TYPES = (
    *({}, {"kind": "rope"}, [], [{}], [[1]], [[[1.0]]], ["a"], [{"a": 1}]),
    *(0, -1, 3, 10**400, 1.5, float("nan"), float("inf"), True),
    *("", "x", "nan", "a\0.py:x", "x" * 5000, datetime.date(2026, 1, 1), datetime.time(1, 2)),
)


@pytest.mark.parametrize("beside", [{}, {"problem": "kepler"}, RIGID])
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


@pytest.mark.parametrize("kind", ROPES)
def test_ropes_by_kind_or_by_name(kind):
    rope = {"num_nodes": 5, "damping": 0.3}
    expected = PROBLEMS[kind](frames=4, **rope).parameters
    # A kind that is said overrules the name.
    for named in ({"kind": kind}, {"problem": kind}, {"problem": "rope", "kind": kind}):
        job = TableJob({**named, "frames": 4, "rope": rope})
        assert job.problem.parameters == expected


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

def fails():
    raise RuntimeError("no such file of mine")

three = 3
"""


def test_problems_of_users(tmp_path):
    (tmp_path / "mine.py").write_text(USER_FILE)

    def load(name, **more):
        return TableJob({"problem": name, **more}, folder=tmp_path).problem

    assert load("mine.py:fixed").name == "fixed"
    assert load("mine.py:made").frames == 4
    assert load("mine.py:made", frames=9).frames == 9
    assert load("mine.py:rope", frames=5).frames == 5
    for name, words in [
        ("mine.py:three", "this is a int"),
        ("mine.py:fxied", "did you mean 'fixed'"),
        ("mine.py:wrong_shape", r"rhs result: \(3,\) given"),
        ("mine.py", "FILE.py:NAME"),
        ("yours.py:x", "No such file"),
    ]:
        with pytest.raises(InputError, match=words):
            load(name)
    with pytest.raises(InputError, match="frames: 3 given; .* sample times are fixed"):
        load("mine.py:fixed", frames=3)
    with pytest.raises(UserCodeError) as caught:
        load("mine.py:fails")
    assert caught.value.__cause__ is not None
