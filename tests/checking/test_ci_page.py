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


@pytest.mark.slow
@pytest.mark.parametrize(
    ("file", "codes", "says"),
    [("steps.py", [0, 0, 0], "velocity_verlet"), ("lagged.py", [1, 1, 0], "WRONG")],
)
def test_the_job_passes_a_right_stepper_and_shows_the_report_on_a_wrong_one(
    file, codes, says, tmp_path
):
    shutil.copy(DOCS / "examples" / file, tmp_path / "steps.py")
    (tmp_path / "test_steps.py").write_text(SHOWN["py"])
    environment = {
        **os.environ,
        "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
        "GITHUB_STEP_SUMMARY": str(tmp_path / "summary.md"),
    }
    for command, code in zip(COMMANDS, codes, strict=True):
        done = subprocess.run(command, shell=True, cwd=tmp_path, env=environment)
        assert done.returncode == code
    assert says in (tmp_path / "summary.md").read_text()
    orders = (tmp_path / "orders.xml").read_text()
    assert 'name="ropeode.velocity_verlet.order-driven.position"' in orders
