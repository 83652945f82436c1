"""The report of a check, in every format, and the command that prints it."""

from __future__ import annotations

import csv
import dataclasses
import io
import json
from pathlib import Path

import pytest

from ropeode.checking import CHECKS, SLOW, Diagnosis
from ropeode.render import FORMATS, format_check
from tests.checking import steps
from tests.checking.no_time_limit import SECONDS, check_stepper
from tests.schemas import assert_conforms

PAGE = Path(__file__).parents[2] / "docs/reference/check.md"


@pytest.fixture(scope="module")
def report():
    only = ["purity", "order-driven", "pins", "stability", "units"]
    report = check_stepper(steps.euler, 2, only=only, diagnose=False)
    diagnosis = Diagnosis("unknown", "no cause stands out", {"lowest_order": 1.0})
    return dataclasses.replace(report, diagnosis=(diagnosis,))


@pytest.mark.parametrize("form", FORMATS)
def test_every_format_has_every_finding(report, form):
    text = format_check(report, form)
    for finding in report.findings:
        assert finding.check in text.replace("\\_", "_")
    assert form == "csv" or "no cause stands out" in text
    assert text.endswith("\n")


def test_text_fits_a_terminal(report):
    lines = format_check(report).splitlines()
    assert max(map(len, lines)) <= 80
    assert lines[2].startswith("Wrong: 1 of 5 checks fails (order-driven). On the problem")
    assert any(line.startswith("-      stability") for line in lines)


def test_json_and_csv_hold_the_same(report):
    text = format_check(report, "json")
    assert_conforms(text)
    whole = json.loads(text)
    rows = list(csv.DictReader(io.StringIO(format_check(report, "csv"))))
    assert [row["status"] for row in rows] == [each["status"] for each in whole["findings"]]
    found = next(each for each in whole["findings"] if each["check"] == "order-driven")
    position = found["convergence"]["quantities"]["position"]
    assert position["observed"] == pytest.approx(1.0, abs=0.2)
    assert len(position["errors"]) == len(found["convergence"]["dt"])
    assert not whole["passed"]


def test_every_check_is_described():
    text = PAGE.read_text()
    assert set(SLOW) <= set(CHECKS)
    for name in CHECKS:
        assert f"`{name}`" in text, name
        assert (f"`{name}`*" in text) == (name in SLOW), name


FILE = str(Path(steps.__file__))
UNLIMITED = ("--time-limit", str(SECONDS))


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        ((f"{FILE}:euler", "--order", "1", "--only", "order-driven"), 0, "Right: 1 of 1 check"),
        ((f"{FILE}:euler", "--order", "2", "--only", "order-driven", "--quick"), 1, "Wrong: 1"),
        (("rk4", "--only", "pins, units"), 0, "Right: 2 of 2 checks passed"),
        ((f"{FILE}:euler", "--order", "two"), 2, "expected_order: 'two'"),
        ((f"{FILE}:elur",), 2, "did you mean 'euler'"),
        (("nowhere.py:step",), 2, "No such file"),
        (("rk4", "--only", "pin"), 2, "did you mean 'pins'"),
        ((f"{FILE}:COUNT",), 2, "a step function, a Stepper"),
    ],
)
def test_the_command_and_its_exit_codes(run, arguments, code, words):
    done = run("check", *arguments, *UNLIMITED)
    assert done.returncode == code
    assert words in (done.stderr if code == 2 else done.stdout)
    assert "Traceback" not in done.stderr


def test_the_command_writes_a_file(run, tmp_path):
    path = tmp_path / "report.json"
    done = run("check", f"{FILE}:euler", "--only", "pins", "--out", str(path), *UNLIMITED)
    assert (done.returncode, done.stdout) == (0, "")
    assert json.loads(path.read_text())["passed"]
