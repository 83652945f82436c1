"""Points by what teachers have: GitHub Classroom, as its runner does it, and otter-grader."""

from __future__ import annotations

import base64
import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from tests.classroom.conftest import write
from tests.time_limit import HANGS_AFTER_S

EXAMPLES = Path(__file__).parents[2] / "docs/examples"
WORKFLOW, TESTS = EXAMPLES / "classroom.yml", EXAMPLES / "otter/tests"
# What a runner puts around the lines of a step.
SHELLS = {None: ["bash", "-e"], "python": ["python"]}
STEP = "def step(acceleration, t, x, v, dt, args):\n"
MIDPOINT = f"""{STEP}
    half, w = x + 0.5 * dt * v, v + 0.5 * dt * acceleration(t, x, v, args)
    return x + dt * w, v + dt * acceleration(t + 0.5 * dt, half, w, args)
"""
EULER = f"{STEP}    return x + dt * v, v + dt * acceleration(t, x, v, args)\n"
SAYS_OF_EULER = "this is explicit-euler; its order is 1"


@pytest.fixture(scope="module")
def said_by(environment):
    """Run a command in a folder; returns what it prints."""

    def call(words, folder, **variables):
        path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
        done = subprocess.run(
            words,
            cwd=folder,
            env={**environment, "PATH": path, **variables},
            capture_output=True,
            text=True,
            timeout=HANGS_AFTER_S,
        )
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    return call


@pytest.fixture(scope="module")
def workflow():
    return yaml.safe_load(WORKFLOW.read_text())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("stepper", "statuses", "points", "says"),
    [
        (MIDPOINT, ["pass"] * 4, 10.0, "Right: "),
        (EULER, ["pass", "fail", "pass", "fail"], 4.0, SAYS_OF_EULER),
        ("def step(:\n", ["fail"] * 4, 0.0, "SyntaxError"),
    ],
)
def test_github_classroom_gets_points(workflow, said_by, tmp_path, stepper, statuses, points, says):
    """The steps run in a student's repository, up to the reporter's."""
    repository = tmp_path / "repository"
    files = {"stepper.py": stepper, "x/other.py": "def other(): ...\n"}
    write(repository, {**files, ".github/workflows/classroom.yml": WORKFLOW.read_text()})
    names = ("RUNNER_TEMP", "GITHUB_OUTPUT", "GITHUB_STEP_SUMMARY")
    temp, output, summary = paths = [tmp_path / name for name in names]
    temp.mkdir()
    variables = {**workflow["env"], **dict(zip(names, map(str, paths), strict=True))}
    (job,) = workflow["jobs"].values()
    pip, *steps = (step for step in job["steps"] if "run" in step)
    # It is installed already.
    assert pip["run"] == 'python -m pip install "$TOOLKIT"'
    for step in steps:
        (tmp_path / "script").write_text(step["run"])
        said_by([*SHELLS[step.get("shell")], "../script"], repository, **variables)
    outputs = dict(line.split("=", 1) for line in output.read_text().splitlines())
    result = json.loads(base64.b64decode(outputs["result"], validate=True))
    tests = result.pop("tests")
    status = "pass" if points == 10.0 else "fail"
    assert result == {"version": 1, "status": status, "max_score": 10}
    assert [each["status"] for each in tests] == statuses
    # As the reporter reads them.
    empty = {"test_code": "", "filename": "", "line_no": 0, "duration": 0}
    for each in tests:
        assert {*each} == {"name", "status", "score", "message", *empty}
        assert each.items() >= empty.items()
    # These are the points that Classroom gets.
    assert sum(each["score"] for each in tests) == points
    assert f"{points:g} of 10 points" in summary.read_text()
    assert says in summary.read_text()


def test_the_reporter_finds_the_result(workflow):
    # It looks for a check of this name.
    *steps, reporter = workflow["jobs"]["run-autograding-tests"]["steps"]
    assert reporter["uses"].startswith("education/autograding-grading-reporter@")
    runner = reporter["with"]["runners"]
    assert reporter["env"] == {
        f"{runner.upper()}_RESULTS": f"${{{{ steps.{runner}.outputs.result }}}}"
    }
    assert [step["id"] for step in steps if "GITHUB_OUTPUT" in step.get("run", "")] == [runner]
    assert workflow["permissions"]["checks"] == "write"


@pytest.fixture(scope="module")
def otter(tmp_path_factory, said_by):
    """Run a command of otter-grader in a folder with `autograder.zip`; returns what it prints."""
    if importlib.util.find_spec("otter") is None:
        pytest.skip("otter-grader is not installed: make test-all")
    folder = tmp_path_factory.mktemp("otter")

    def call(*words):
        return said_by([sys.executable, "-m", "otter", *words], folder, HOME=str(folder))

    call("generate", "-t", str(TESTS), "-o", "autograder.zip")
    return call


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "points", "says"),
    [
        (MIDPOINT, 10.0, "All test cases passed!"),
        (EULER, 2.0, SAYS_OF_EULER),
        ("def other(): ...\n", 0.0, "there is no function step("),
    ],
)
def test_a_notebook_has_points_by_otter(otter, text, points, says, tmp_path):
    """A teacher has a zip file of tests, and the notebooks of students."""
    import nbformat  # Slow to import.

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
