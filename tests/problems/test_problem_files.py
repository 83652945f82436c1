"""Problems in files of the user's."""

from __future__ import annotations

import pytest

from ropeode.errors import InputError
from ropeode.problems.files import load_problem

FILE = """
from ropeode import InextensibleRope, Rope

extensible, inextensible = Rope(num_nodes=3), InextensibleRope(num_nodes=3)
number = 3
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "own.py").write_text(FILE)
    return tmp_path


@pytest.mark.parametrize("name", ["extensible", "inextensible"])
def test_ropes_of_either_kind_become_problems(folder, name):
    problem = load_problem(f"own.py:{name}", folder=folder, frames=2)
    assert problem.rigid == (name == "inextensible")
    assert problem.frames == 2


def test_what_is_no_problem_is_refused(folder):
    with pytest.raises(InputError, match=r"a Problem, a rope, .* and this is a int"):
        load_problem("own.py:number", folder=folder)
