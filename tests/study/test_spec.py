"""What studies take: spec files, and arguments with a line for each fault."""

from __future__ import annotations

import datetime
import functools
import itertools
import re
import tomllib

import pytest

from ropeode import (
    Problem,
    Rope,
    accuracy_table,
    error_curves,
    explain_stepper,
    horizon,
    node_paths,
    work_precision,
)
from ropeode.errors import InputError, UserCodeError
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


DECAY = Problem(lambda t, y, args: -y, [1.0], [0.0, 1.0], name="decay")
OSCILLATOR = PROBLEMS["oscillator"]()


def solve(problem, rtol):
    raise AssertionError("not to be run")


def same_name(problem, rtol):
    raise AssertionError("not to be run")


functools.update_wrapper(same_name, solve)
explain = functools.partial(explain_stepper, "rk4")
RIGID = {"kind": "inextensible-rope"}
USER_FILE = """
import jax.numpy as jnp
from ropeode import Problem

fixed = Problem(lambda t, y, args: -y, [1.0], [0.0, 1.0, 2.0], name="fixed")

def wrong_shape():
    return Problem(lambda t, y, args: jnp.ones(3), [1.0], [0.0, 1.0])

def fails():
    raise RuntimeError("no such file of mine")
"""

BAD = [
    (accuracy_table, {"steppers": ["rk4", "rk4"]}, "each stepper once"),
    (accuracy_table, {"steps_per_frame": []}, "steps_per_frame: "),
    (accuracy_table, {"steps_per_frame": [4, 0]}, r"steps_per_frame: .*\(0 is below 1"),
    (accuracy_table, {"steps_per_frame": [4, 4]}, "one is repeated"),
    (accuracy_table, {"steps_per_frame": 16}, "steps_per_frame: 16 given"),
    (accuracy_table, {"norm": "state-max"}, "norm: 'state-max' given; .* those that 'rope' has"),
    (error_curves, {"problem": DECAY, "norm": "position-max"}, "norm: 'position-max' given"),
    (error_curves, {"problem": DECAY, "steppers": ["rkn4"]}, "needs a second-order problem"),
    (error_curves, {"rtol": 1.0}, "rtol: 1.0 given"),
    (node_paths, {"problem": DECAY}, "problem: .* 2 or 3 components"),
    (node_paths, {"steps_per_frame": 1.5}, "steps_per_frame: "),
    (explain, {"norm": "state-max"}, "norm: 'state-max' given"),
    (horizon, {"spans": [0, "far"]}, "spans: 0 given; .* > 0", "spans: 'far' given; .* > 0"),
    (horizon, {"spans": [1e6], "problem": OSCILLATOR}, "spans: 1000000.0 given; allowed: at most"),
    (work_precision, {"methods": []}, r"methods: \[\] given; allowed: at least one method"),
    (work_precision, {"methods": ["rk4", "rk4"]}, "each method once"),
    (work_precision, {"methods": [solve, same_name]}, "another __name__"),
    (work_precision, {"methods": [lambda p, tol: 0]}, "name its parameters problem and rtol"),
    (work_precision, {"methods": ["rk5", "scipy:RK54"]}, "mean 'rk4'", "mean 'RK45'"),
    (work_precision, {"methods": ["diffrax:Tsit5:steps"]}, "'steps' given"),
    (work_precision, {"methods": ["scipy:BDF:constant"]}, "it chooses among orders 1 to 5"),
    (work_precision, {"methods": ["diffrax:KenCarp4"]}, "write diffrax:KenCarp4:constant"),
    (work_precision, {"methods": ["rk4"], "rtol": [1e-3]}, "none where all methods have constant"),
    (work_precision, {"rtol": [1e-3, 1e-3]}, "different numbers from 1e-13 to 0.1"),
    (work_precision, {"rounds": 0}, "rounds: 0 given"),
    # The values of a spec; those of a rope, of its kind, and of a user's file.
    (TableJob, {"rope": 3}, "rope: 3 given; allowed: a table"),
    (TableJob, {"problem": "kepler", "rope": {"damping": 0.1}}, "rope: .* leave out one"),
    (TableJob, {"problem": {"kind": "rope"}}, "problem: {'kind': 'rope'} given; .* = \"rope\""),
    (TableJob, {"kind": "inextensible"}, "did you mean 'inextensible-rope'"),
    (TableJob, {"problem": "kepler", **RIGID}, "kind: .* leave out one"),
    (TableJob, {**RIGID, "rope": {"stiffness": 9.0}}, "stiffness: 9.0 given; allowed: none with"),
    (TableJob, {**RIGID, "rope": {"num_nodes": 4, "pinned": [0, 3]}}, r"pinned: \[0, 3\] given"),
    (
        *(TableJob, {"frame": 3, "steppers": ["rk5"], "rope": {"damping": -1, "nodes": 3}}),
        *("did you mean 'rk4'", "frame", "damping", "nodes"),
    ),
    (TableJob, {"problem": "mine.py:fxied"}, "did you mean 'fixed'"),
    (TableJob, {"problem": "mine.py:wrong_shape"}, r"rhs result: \(3,\) given"),
    (TableJob, {"problem": "mine.py"}, "FILE.py:NAME"),
]


@pytest.mark.parametrize("given", BAD, ids=lambda given: given[-1])
def test_each_fault_is_a_line_with_its_fix(given, small_rope, tmp_path):
    function, named, *words = given
    (tmp_path / "mine.py").write_text(USER_FILE)
    computing = []
    named = {"problem": small_rope, **named, "progress": lambda *said: computing.append(said)}
    with pytest.raises(InputError) as caught:
        TableJob(given[1], tmp_path) if function is TableJob else function(**named)
    for line, word in zip(caught.value.problems, words, strict=True):
        assert re.search(word, line), line
        assert "Fix: " in line or "which does not exist" in line
    assert not computing


def test_what_a_users_code_does_is_told_as_its_own(small_rope, tmp_path):
    def broken(acceleration, t, x, v, dt, args):
        return x * float("nan"), v

    (tmp_path / "mine.py").write_text(USER_FILE)
    with pytest.raises(UserCodeError, match="no such file of mine"):
        TableJob({"problem": "mine.py:fails"}, tmp_path)
    with pytest.raises(UserCodeError, match="its first step from a regular state is not finite"):
        explain_stepper(broken, small_rope, steps_per_frame=[4, 8])
