"""What no study can use is told in a line for each fault, before anything is computed."""

from __future__ import annotations

import functools
import re

import pytest

from ropeode import (
    Problem,
    accuracy_table,
    energy_curves,
    error_curves,
    explain_stepper,
    horizon,
    node_paths,
    work_precision,
)
from ropeode.errors import InputError, UserCodeError
from ropeode.problems import PROBLEMS
from ropeode.study import TableJob

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
    (accuracy_table, {"steppers": []}, "steppers: "),
    (accuracy_table, {"steppers": ["rk5", "verlet"]}, "did you mean 'rk4'", "'verlet' given"),
    (accuracy_table, {"steppers": ["rk4", "rk4"]}, "each stepper once"),
    (accuracy_table, {"steps_per_frame": []}, "steps_per_frame: "),
    (accuracy_table, {"steps_per_frame": [4, 0]}, r"steps_per_frame: .*\(0 is below 1"),
    (accuracy_table, {"steps_per_frame": [4, 4]}, "one is repeated"),
    (accuracy_table, {"steps_per_frame": [4.5]}, "not whole"),
    (accuracy_table, {"steps_per_frame": 16}, "steps_per_frame: 16 given"),
    (accuracy_table, {"norm": "state-max"}, "norm: 'state-max' given; .* those that 'rope' has"),
    (error_curves, {"problem": DECAY, "norm": "position-max"}, "norm: 'position-max' given"),
    (error_curves, {"problem": DECAY, "steppers": ["rkn4"]}, "needs a second-order problem"),
    (error_curves, {"rtol": 1.0}, "rtol: 1.0 given"),
    (energy_curves, {"steps_per_frame": [0]}, "steps_per_frame: "),
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
    (work_precision, {"rtol": 1e-3}, "rtol: 0.001 given"),
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
    (TableJob, {"problem": "yours.py:x"}, "No such file"),
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
