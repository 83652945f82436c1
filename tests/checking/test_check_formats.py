"""The command that checks a stepper: its exit codes, and what it writes."""

from __future__ import annotations

import json

import pytest

from tests.checking.no_time_limit import SECONDS

FILE = "def euler(rhs, t, y, dt, args):\n    return y + dt * rhs(t, y, args)\n"


@pytest.fixture
def check(run, tmp_path):
    (tmp_path / "mine.py").write_text(FILE)
    return lambda words: run("check", *words.split(), "--time-limit", str(SECONDS))


@pytest.mark.parametrize(
    ("words", "code", "says"),
    [
        ("mine.py:euler --order 1 --only order-driven", 0, "Right: 1 of 1 check"),
        ("mine.py:euler --order 2 --only order-driven --quick", 1, "Wrong: 1"),
        ("mine.py:euler --order two", 2, "expected_order: 'two'"),
        ("mine.py:elur", 2, "did you mean 'euler'"),
    ],
)
def test_exit_codes(check, words, code, says):
    done = check(words)
    assert done.returncode == code
    assert says in (done.stderr if code == 2 else done.stdout)
    assert "Traceback" not in done.stderr


def test_the_command_writes_a_file(check, tmp_path):
    done = check("mine.py:euler --only pins,units --out report.json")
    assert (done.returncode, done.stdout) == (0, "")
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["passed"]
    assert len(report["findings"]) == 2
