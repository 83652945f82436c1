"""The report of a check, in every format, and the command that prints it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from ropeode.checking import CHECKS, SLOW
from tests.checking import steps
from tests.checking.no_time_limit import SECONDS

PAGE = Path(__file__).parents[2] / "docs/reference/check.md"


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
