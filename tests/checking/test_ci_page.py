"""The example of docs/howto/ci.md, run as a service runs it."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

DOCS = Path(__file__).parents[2] / "docs"
FENCE = re.compile(r"^```(\w+)\n(.*?)^```", re.MULTILINE | re.DOTALL)
SHOWN = dict(FENCE.findall((DOCS / "howto/ci.md").read_text()))
(JOB,) = yaml.safe_load(SHOWN["yaml"])["jobs"].values()
# What is run in the project itself; the installation has taken place.
COMMANDS = [
    step["run"] for step in JOB["steps"] if "run" in step and "working-directory" not in step
]


def run_job(folder: Path) -> list[int]:
    """The exit code of each command, in a folder with the step and its test."""
    (folder / "test_steps.py").write_text(SHOWN["py"])
    environment = {
        **os.environ,
        "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
        "GITHUB_STEP_SUMMARY": str(folder / "summary.md"),
    }
    return [
        subprocess.run(
            each, shell=True, cwd=folder, env=environment, capture_output=True
        ).returncode
        for each in COMMANDS
    ]


@pytest.mark.slow
def test_a_right_stepper_passes(tmp_path):
    shutil.copy(DOCS / "examples/steps.py", tmp_path)
    assert run_job(tmp_path) == [0, 0, 0]
    assert (
        'name="ropeode.velocity_verlet.order-driven.position"'
        in (tmp_path / "orders.xml").read_text()
    )
    assert "velocity_verlet" in (tmp_path / "summary.md").read_text()


@pytest.mark.slow
def test_a_wrong_stepper_fails_and_the_report_is_shown(tmp_path):
    shutil.copy(DOCS / "examples/lagged.py", tmp_path / "steps.py")
    assert run_job(tmp_path) == [1, 1, 0]
    assert "WRONG" in (tmp_path / "summary.md").read_text()
