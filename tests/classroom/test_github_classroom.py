"""The workflow for GitHub Classroom: its steps are run as a runner does, up to the reporter's."""

from __future__ import annotations

import base64
import json
import os
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from tests.time_limit import HANGS_AFTER_S

WORKFLOW = Path(__file__).parents[2] / "docs/examples/classroom.yml"
# What a runner puts around the lines of a step.
SHELLS = {None: ["bash", "-e"], "python": ["python"]}
# As the reporter reads them; of these it adds up the scores.
TEST = {
    "name": str,
    "status": str,
    "score": (int, float),
    "message": str,
    "test_code": str,
    "filename": str,
    "line_no": int,
    "duration": int,
}

MIDPOINT = """
def step(acceleration, t, x, v, dt, args):
    half, w = x + 0.5 * dt * v, v + 0.5 * dt * acceleration(t, x, v, args)
    return x + dt * w, v + dt * acceleration(t + 0.5 * dt, half, w, args)
"""
EULER = """
def step(acceleration, t, x, v, dt, args):
    return x + dt * v, v + dt * acceleration(t, x, v, args)
"""


@pytest.fixture(scope="module")
def workflow():
    return yaml.safe_load(WORKFLOW.read_text())


@pytest.fixture
def run_steps(workflow, tmp_path, cache):
    """Run the steps in a student's repository; returns the outputs and the summary."""

    def call(stepper):
        repository, temp, tools = (tmp_path / each for each in ("repository", "temp", "tools"))
        for folder in (temp, tools, repository / ".github/workflows", repository / "x"):
            folder.mkdir(parents=True)
        (repository / "stepper.py").write_text(stepper)
        (repository / "README.md").write_text("The assignment.\n")
        (repository / "x/other.py").write_text("def other(): ...\n")
        (repository / ".github/workflows/classroom.yml").write_text(WORKFLOW.read_text())
        # It is installed already: what pip is asked for is written down.
        (tools / "python").write_text(
            f'#!/bin/sh\n[ "$2" = pip ] && echo "$@" >> "$RUNNER_TEMP/pip" && exit\n'
            f'exec {shlex.quote(sys.executable)} "$@"\n'
        )
        (tools / "python").chmod(0o755)
        files = {name: tmp_path / name for name in ("GITHUB_OUTPUT", "GITHUB_STEP_SUMMARY")}
        environment = {
            **os.environ,
            **workflow["env"],
            **{name: str(path) for name, path in files.items()},
            "RUNNER_TEMP": str(temp),
            "XDG_CACHE_HOME": cache,
            "PATH": f"{tools}:{os.environ['PATH']}",
        }
        (job,) = workflow["jobs"].values()
        for step in job["steps"]:
            if "run" in step:
                script = tmp_path / "script"
                script.write_text(step["run"])
                subprocess.run(
                    [*SHELLS[step.get("shell")], str(script)],
                    cwd=repository,
                    env=environment,
                    timeout=HANGS_AFTER_S,
                    check=True,
                )
        assert (temp / "pip").read_text() == f"-m pip install {workflow['env']['TOOLKIT']}\n"
        lines = files["GITHUB_OUTPUT"].read_text().splitlines()
        outputs = dict(line.split("=", 1) for line in lines)
        return outputs, files["GITHUB_STEP_SUMMARY"].read_text()

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
    assert set(result) == {"version", "status", "max_score", "tests"}
    assert (result["version"], result["max_score"]) == (1, 10)
    assert result["status"] == ("pass" if points == 10.0 else "fail")
    assert [each["status"] for each in result["tests"]] == statuses
    for each in result["tests"]:
        assert set(each) == set(TEST)
        assert all(isinstance(each[name], kind) for name, kind in TEST.items())
    # These are the points that Classroom gets.
    assert sum(each["score"] for each in result["tests"]) == points
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
