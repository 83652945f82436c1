"""Spec files."""

from __future__ import annotations

import datetime
import itertools
import tomllib

import pytest

from ropeode import Rope
from ropeode.errors import InputError
from ropeode.problems import PROBLEMS, ROPES
from ropeode.study import (
    DEFAULT_STEPS_PER_FRAME,
    TableJob,
    TableSpec,
    commented_table,
    default_steppers,
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


@pytest.mark.parametrize("kind", ROPES)
def test_ropes_by_kind_or_by_name(kind):
    rope = {"num_nodes": 5, "damping": 0.3}
    expected = PROBLEMS[kind](frames=4, **rope).parameters
    # A kind that is said overrules the name.
    for named in ({"kind": kind}, {"problem": kind}, {"problem": "rope", "kind": kind}):
        job = TableJob({**named, "frames": 4, "rope": rope})
        assert job.problem.parameters == expected
