"""Points by otter-grader, as a teacher has it: a zip file of tests, and notebooks of students."""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path

import nbformat
import pytest

from tests.classroom.test_github_classroom import EULER, MIDPOINT
from tests.time_limit import HANGS_AFTER_S

TESTS = Path(__file__).parents[2] / "docs/examples/otter/tests"


@pytest.fixture(scope="module")
def otter(tmp_path_factory, cache):
    """Run a command of otter-grader in a folder with `autograder.zip`; returns what it prints."""
    if importlib.util.find_spec("otter") is None:
        pytest.skip("otter-grader is not installed: make test-all")
    folder = tmp_path_factory.mktemp("otter")

    def call(*words):
        environment = {**os.environ, "XDG_CACHE_HOME": cache, "HOME": str(folder)}
        done = subprocess.run(
            [sys.executable, "-m", "otter", *words],
            cwd=folder,
            env=environment,
            capture_output=True,
            text=True,
            timeout=HANGS_AFTER_S,
            check=False,
        )
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    call("generate", "-t", str(TESTS), "-o", "autograder.zip")
    return call


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "points", "says"),
    [
        (MIDPOINT, 10.0, "All test cases passed!"),
        (EULER, 2.0, "this is explicit-euler; its order is 1"),
        ("def other(): ...\n", 0.0, "there is no function step("),
    ],
)
def test_a_notebook_has_points(otter, text, points, says, tmp_path):
    cells = ["import otter\ngrader = otter.Notebook()", text, 'grader.check("stepper")']
    cells = [nbformat.v4.new_code_cell(each) for each in cells]
    notebook = tmp_path / "submission.ipynb"
    nbformat.write(nbformat.v4.new_notebook(cells=cells), notebook)
    otter("run", "--autograder", "autograder.zip", "-o", str(tmp_path), str(notebook))
    tests = json.loads((tmp_path / "results.json").read_text())["tests"]
    (own,) = (each for each in tests if each["name"] == "stepper")
    assert (own["score"], own["max_score"]) == (points, 10.0)
    assert says in own["output"]
    # As a student checks a script.
    (tmp_path / "stepper.py").write_text(text)
    said = otter("check", str(tmp_path / "stepper.py"), "-t", str(TESTS))
    assert ("All tests passed!" in said) == (points == 10.0)
