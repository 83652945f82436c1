"""The pytest plugin, in a project that knows nothing else of ropeode."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest

# Here, because pytester forgets what its runs import, and NumPy loads no compiled module twice.
import scipy.special  # noqa: F401
import yaml

pytest_plugins = ["pytester"]

STEPS = """
import pytest
from ropeode.checking import CHECKS
from tests.checking.mutants.originals import explicit_euler as euler, velocity_verlet as verlet

pytestmark = pytest.mark.ropeode(time_limit=1e6)

def broken(acceleration, t, x, v, dt, args):
    return y, v
"""
TESTS = """
def test_order(ropeode):
    assert ropeode.assert_order(verlet, 2, only=["order-driven"]).passed

@pytest.mark.ropeode(only=["order-driven"])
def test_wrong_order(ropeode):
    ropeode.assert_order(euler, 2)

@pytest.mark.ropeode(only=["order-driven"])
def test_converges(ropeode):
    ropeode.assert_converges(euler)

def test_energy_grows(ropeode):
    ropeode.assert_conserves_energy(euler)

def test_user_error(ropeode):
    ropeode.assert_order(broken, 2)

def test_wrong_argument(ropeode):
    ropeode.check(verlet, 2, only=["pin"])

@pytest.mark.ropeode(only=["pins", "float32"], skip=["float32"])
class TestMarkers:
    def test_all(self, ropeode):
        names = [finding.check for finding in ropeode.check(verlet, 2).findings]
        assert names == ["pins"]

    @pytest.mark.ropeode(skip=[])
    def test_the_nearer_one_counts(self, ropeode):
        assert len(ropeode.check(verlet, 2).findings) == 2
"""
OPTIONS = """
FEW = ("energy", "pins", "units", "order-driven")

@pytest.mark.ropeode(skip=[name for name in CHECKS if name not in FEW])
def test_quick(ropeode):
    names = [finding.check for finding in ropeode.check(verlet, 2).findings]
    assert names == ["order-driven", "units"]

def test_format(ropeode):
    ropeode.assert_order(euler, 2, only=["order-driven"])
"""


def test_verdicts_reports_and_properties(pytester):
    pytester.makepyfile(test_steps=STEPS + TESTS)
    result = pytester.runpytest("--strict-markers", "-W", "error", "--junitxml=found.xml")
    result.assert_outcomes(passed=4, failed=4)
    text = result.stdout.str()
    for words in (
        "Check of explicit_euler: claimed to be of order 2",
        "Wrong: 1 of 1 check fails (order-driven). On the problem",
        "energy grows to",
        "claimed to stay bounded",
        "did you mean 'pins'",
        # The user's own line, and none of ours.
        "return y, v",
        "NameError: name 'y' is not defined",
    ):
        assert words in text
    assert "site-packages" not in text
    assert "ropeode/checking" not in text
    tree = ElementTree.parse(pytester.path / "found.xml")
    found = {
        (case.get("name"), each.get("name")): float(each.get("value"))
        for case in tree.iter("testcase")
        for each in case.iter("property")
    }
    assert abs(found["test_order", "ropeode.velocity_verlet.order-driven.position"] - 2.0) < 0.05
    assert (
        abs(found["test_wrong_order", "ropeode.explicit_euler.order-driven.velocity"] - 1.0) < 0.2
    )


def test_options(pytester):
    pytester.makepyfile(test_steps=STEPS + OPTIONS)
    options = ("--ropeode-quick", "--ropeode-skip", "pins,float32", "--ropeode-format", "markdown")
    result = pytester.runpytest(*options)
    result.assert_outcomes(passed=1, failed=1)
    result.stdout.fnmatch_lines(["# Check of explicit_euler*", "| WRONG*"])


# The example of docs/howto/ci.md, run as a service runs it.
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
