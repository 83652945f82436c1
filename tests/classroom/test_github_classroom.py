"""The workflow for GitHub Classroom: its steps are run as a runner does, up to the reporter's."""

from __future__ import annotations

import base64
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from tests.classroom.conftest import write
from tests.time_limit import HANGS_AFTER_S

WORKFLOW = Path(__file__).parents[2] / "docs/examples/classroom.yml"
# What a runner puts around the lines of a step.
SHELLS = {None: ["bash", "-e"], "python": ["python"]}
STEP = "def step(acceleration, t, x, v, dt, args):\n"
MIDPOINT = f"""{STEP}
    half, w = x + 0.5 * dt * v, v + 0.5 * dt * acceleration(t, x, v, args)
    return x + dt * w, v + dt * acceleration(t + 0.5 * dt, half, w, args)
"""
EULER = f"{STEP}    return x + dt * v, v + dt * acceleration(t, x, v, args)\n"


@pytest.fixture(scope="module")
def workflow():
    return yaml.safe_load(WORKFLOW.read_text())


@pytest.fixture
def run_steps(workflow, tmp_path, cache):
    """Run the steps in a student's repository; returns the outputs and the summary."""
    repository, temp = tmp_path / "repository", tmp_path / "temp"
    output, summary = tmp_path / "output", tmp_path / "summary"

    def call(stepper):
        files = {"stepper.py": stepper, "x/other.py": "def other(): ...\n"}
        write(repository, {**files, ".github/workflows/classroom.yml": WORKFLOW.read_text()})
        temp.mkdir()
        environment = {
            **os.environ,
            **workflow["env"],
            "GITHUB_OUTPUT": str(output),
            "GITHUB_STEP_SUMMARY": str(summary),
            "RUNNER_TEMP": str(temp),
            "XDG_CACHE_HOME": cache,
            "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
        }
        (job,) = workflow["jobs"].values()
        pip, *steps = (step for step in job["steps"] if "run" in step)
        # It is installed already.
        assert pip["run"] == 'python -m pip install "$TOOLKIT"'
        for step in steps:
            (tmp_path / "script").write_text(step["run"])
            subprocess.run(
                [*SHELLS[step.get("shell")], str(tmp_path / "script")],
                cwd=repository,
                env=environment,
                timeout=HANGS_AFTER_S,
                check=True,
            )
        outputs = dict(line.split("=", 1) for line in output.read_text().splitlines())
        return outputs, summary.read_text()

    return call


@pytest.mark.slow
@pytest.mark.parametrize(
    ("stepper", "statuses", "points", "says"),
    [
        (MIDPOINT, ["pass"] * 4, 10.0, "Right: "),
        (EULER, ["pass", "fail", "pass", "fail"], 4.0, "this is explicit-euler; its order is 1"),
        ("def step(:\n", ["fail"] * 4, 0.0, "SyntaxError"),
    ],
)
def test_points_are_reported(run_steps, stepper, statuses, points, says):
    outputs, summary = run_steps(stepper)
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
    assert f"{points:g} of 10 points" in summary
    assert says in summary


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
