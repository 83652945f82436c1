"""Problems in files of the user's."""

from __future__ import annotations

import random
import sys

import pytest

from ropeode import as_stepper
from ropeode.errors import InputError, UserCodeError
from ropeode.problems import keep_apart, load_problem

FOR_SCIPY = """
import math
import jax.numpy as jnp
import numpy as np
from ropeode import InextensibleRope, Rope

{names}
number = 3
extensible, inextensible = Rope(num_nodes=3), InextensibleRope(num_nodes=3)

def pendulum(t, y):
    return np.array([y[1], -math.sin(y[0])])

def of_strength(t, y, strength):
    return [y[1], -strength * y[0]]

def in_jax(t, y, args):
    return jnp.stack([y[1], -args[0] * jnp.sin(y[0])])

def of_angle(angle, y, strength):
    return [y[1], -strength * y[0]]

def of_others(mass, length):
    return mass * length
"""


def loaded(tmp_path, name, names="y0, t_span = [1.0, 0.0], (0, 5)", **more):
    (tmp_path / "own.py").write_text(FOR_SCIPY.format(names=names))
    return load_problem(f"own.py:{name}", folder=tmp_path, **more)


def test_right_hand_sides_with_what_stands_beside_them(tmp_path):
    problem = loaded(tmp_path, "pendulum")
    assert (problem.name, problem.in_python, problem.frames) == ("pendulum", True, 20)
    assert problem.ts[[0, -1]].tolist() == [0.0, 5.0]
    assert loaded(tmp_path, "pendulum", frames=3).frames == 3
    for name in ("extensible", "inextensible"):
        problem = loaded(tmp_path, name, frames=2)
        assert (problem.rigid, problem.frames) == (name == "inextensible", 2)
    beside = "y0, ts, args = [1.0, 0.0], [0.0, 1.0, 4.0], (2.0,)"
    for name in ("of_strength", "in_jax", "of_angle"):
        problem = loaded(tmp_path, name, beside)
        assert problem.ts.tolist() == [0.0, 1.0, 4.0]
        assert not problem.in_python
        assert float(problem.args[0]) == 2.0
    with pytest.raises(InputError, match="frames: 3 given; .* sample times are fixed"):
        loaded(tmp_path, "in_jax", beside, frames=3)


@pytest.mark.parametrize(
    ("name", "names", "words"),
    [
        ("pendulum", "", r"add the line `y0 = .*` and add the line `t_span = \(0\.0, 10\.0\)`"),
        ("pendulum", "y0, ts, events = [1.0, 0.0], [0, 1], 3", r"events: 3 .*/events\.md"),
        ("number", "", r"a Problem, a rope, .* and this is a int"),
        ("of_others", "", r"a function of \(mass, length\)' given; .* t and y, with y0 and t_span"),
    ],
)
def test_what_is_missing_is_said_with_the_line_to_write(tmp_path, name, names, words):
    with pytest.raises(InputError, match=words):
        loaded(tmp_path, name, names)


BESIDE = {
    "steps.py": """
import parts.gravity
import random
from helper import NAME, other
from parts import gravity
import ropeode

assert random.random() >= 0 and ropeode.Rope
assert parts.gravity is gravity

def step(rhs, t, y, dt, args):
    from late import late
    return NAME, other.NAME, gravity.NAME, late
""",
    "helper.py": "import other\nNAME = 'PLACE'\n",
    "other.py": "NAME = 'other PLACE'\n",
    "late.py": "from helper import NAME as late\n",
    "parts/__init__.py": "from . import gravity\n",
    "parts/gravity.py": "from other import NAME\n",
    # Neither of these stands for the one that everybody knows.
    "random.py": "raise SystemExit",
    "ropeode.py": "raise SystemExit",
}


def beside(folder):
    for name, text in BESIDE.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text.replace("PLACE", folder.name))
    return folder / "steps.py"


def test_a_file_imports_what_lies_beside_it_and_no_other_does(tmp_path):
    paths = [beside(tmp_path / name) for name in ("anna", "bert")]
    steps = [as_stepper(f"{path}:step").function for path in paths]
    for path, step in zip(paths, steps, strict=True):
        own = path.parent.name
        assert step(None, 0.0, 0.0, 0.1, None) == (own, f"other {own}", f"other {own}", own)
    assert not {"helper", "other", "late", "parts"} & {*sys.modules}
    assert sys.modules["random"] is random
    # What it imports is read again with it, and nothing is left in the folder.
    (tmp_path / "anna/other.py").write_text("NAME = 'other bert'\n")
    assert as_stepper(f"{paths[0]}:step").function(None, 0.0, 0.0, 0.1, None)[1] == "other bert"
    assert not [*tmp_path.rglob("__pycache__")]


def test_files_of_different_people_import_none_of_each_other(tmp_path):
    keep_apart(tmp_path)
    (tmp_path / "bert.py").write_text("def step(rhs, t, y, dt, args): return y\n")
    (tmp_path / "anna.py").write_text("from bert import step\n")
    with pytest.raises(UserCodeError, match="No module named 'bert'"):
        as_stepper(f"{tmp_path}/anna.py:step")
