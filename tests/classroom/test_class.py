"""Submissions that crash, hang, print or copy: each has its row, and none disturbs another."""

from __future__ import annotations

import csv
import functools
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.classroom import a_class
from tests.time_limit import HANGS_AFTER_S

RIGHT = a_class.CLASS["right"]
# By its name: status, verdict, points, and the beginning of the message or of the marks.
EXPECTED = {
    "borrows": ("checked", "right", "10", ""),
    "copied": ("checked", "right", "10", ""),
    "crashes": ("crashed", "wrong", "0", "purity: the step ended its process (SIGSEGV)"),
    "empty": ("no stepper", "", "0", "stepper: 'empty.py:step' given"),
    "exits": ("crashed", "wrong", "0", "purity: the step ended its process (exit code 0)"),
    "hangs": ("out of time", "", "0", "step: a trial of a few steps did not finish within 3 s"),
    "hoards": ("out of memory", "", "0", "it needed more than 1500 MiB of memory"),
    "no-function": ("no stepper", "", "0", "name in no-function.py: 'step' given"),
    "prints": ("checked", "right", "10", ""),
    "right": ("checked", "right", "10", ""),
    "syntax": ("syntax error", "", "0", "stepper: the file syntax.py: it raised SyntaxError"),
    "wrong": ("checked", "wrong", "4", "at dt = 0 the step solves another equation"),
}


@pytest.fixture
def check(ropeode):
    """Run `ropeode check` as a process in an empty folder."""
    return functools.partial(ropeode, "check")


def rows_printed(done):
    return {row["submission"]: row for row in csv.DictReader(done.stdout.splitlines())}


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["right.py", "--name", "step"], "name: 'step' given; allowed: none but with a FOLDER"),
        (["right.py", "--memory", "100"], "memory: '100' given"),
        (["none", "--rubric", "x.toml"], "rubric: 'x.toml' given"),
        ([".", "--format", "latex"], "format: 'latex' given; allowed: text, csv, json"),
        ([".", "--rubric", "bad.toml"], "rubric: item[1].points: 'many' given"),
        ([".", "--memory", "-1"], "memory: '-1' given"),
        ([".", "-o", "right.py"], "out: 'right.py' given"),
        ([".", "-o", "."], "out: '.' given; allowed: another folder"),
        ([".", "--no-code"], "allowed: no Python file, with --no-code"),
        ([".", "--only", "pin"], "check: 'pin' given"),
    ],
)
def test_options_that_cannot_be_used(run, tmp_path, monkeypatch, words, says):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("ROPEODE_NO_CODE", "")
    a_class.write(tmp_path, {"right": RIGHT})
    (tmp_path / "bad.toml").write_text('[[item]]\nname = "a"\npoints = "many"\n')
    done = run("check", *words)
    assert (done.returncode, done.stdout) == (2, "")
    assert says in done.stderr


@pytest.mark.slow
def test_each_submission_has_its_row_and_is_not_checked_again(check, rows_in, tmp_path):
    folder = a_class.write(tmp_path / "class")
    limits = ("--time-limit", "3", "--memory", "1500")
    words = ("class", "--name", "step", "--order", "1", *limits, "-o", "out")
    done = check(*words)
    rows = rows_in(tmp_path / "out")
    assert done.returncode == 2
    # What submissions print is nowhere.
    assert done.stdout == ""
    assert list(rows) == sorted(EXPECTED)
    for name, (status, verdict, points, message) in EXPECTED.items():
        row = rows[name]
        assert (row["status"], row["verdict"], row["points"]) == (status, verdict, points), row
        assert row["message"].startswith(message), row
        assert (tmp_path / f"out/feedback/{name}.html").is_file()
    assert rows["right"]["marks"] == "same as borrows, copied"
    assert rows["borrows"]["marks"] == "same as copied, right; imports as_stepper of ropeode"
    assert rows["prints"]["marks"] == rows["wrong"]["marks"] == ""
    assert "the acceleration is 0.1% too large" in (tmp_path / "out/feedback/wrong.md").read_text()
    page = (tmp_path / "out/feedback/syntax.md").read_text()
    assert "SyntaxError: expected ':'" in page

    (folder / "empty.py").write_text(RIGHT)
    times = {each.name: each.stat().st_mtime_ns for each in (tmp_path / "out/results").iterdir()}
    check(*words)
    again = {each.name: each.stat().st_mtime_ns for each in (tmp_path / "out/results").iterdir()}
    assert {name for name in times if times[name] != again[name]} == {"empty.json"}
    assert rows_in(tmp_path / "out")["empty"]["points"] == "10"


LEAVES_TRACES = """
import builtins, os, sys
import numpy as np
import ropeode.steppers.registry
builtins.left_behind = 1
sys.modules["left_behind"] = sys
np.sum = None
ropeode.steppers.registry.STEPPERS.clear()
open("left_behind", "w").write("x")
def step(acceleration, t, x, v, dt, args):
    v = v + dt * acceleration(t, x, v, args)
    return x + dt * v, v
"""
LOOKS_FOR_TRACES = """
import builtins, os, sys
import numpy as np
from ropeode import as_stepper
assert not hasattr(builtins, "left_behind")
assert "left_behind" not in sys.modules
assert not os.path.exists("left_behind")
assert np.sum([1, 2]) == 3
as_stepper("rk4")
def step(acceleration, t, x, v, dt, args):
    v = v + dt * acceleration(t, x, v, args)
    return x + dt * v, v
"""


@pytest.mark.slow
def test_no_submission_sees_the_state_of_another(check, tmp_path):
    texts = {f"a{i}": LEAVES_TRACES for i in range(3)} | {
        f"b{i}": LOOKS_FOR_TRACES for i in range(3)
    }
    a_class.write(tmp_path / "class", texts)
    rows = rows_printed(check("class", "--only", "pins,free-flight", "--format", "csv"))
    assert [rows[f"b{i}"]["verdict"] for i in range(3)] == ["right"] * 3, rows


KILLS = {
    "its parent": "os.kill(os.getppid(), signal.SIGKILL)",
    "its group": "os.kill(0, signal.SIGKILL)",
    "its line": "os.closerange(0, 100)",
    "writes into it": (
        "for n in range(3, 100):\n    try: os.write(n, b'[1]\\n{')\n    except OSError: pass"
    ),
    "sleeps": "time.sleep(1000)",
    "memory": "hoard = bytearray(2**31)",
    "holds the lock": "sum(range(10**15))",
    "exits": "raise SystemExit(0)",
}


@pytest.mark.slow
def test_what_harms_processes_harms_no_other_submission(check, tmp_path):
    begins = "import os, signal, time\n"
    texts = {name: f"{begins}{line}\n{RIGHT}" for name, line in KILLS.items()}
    a_class.write(tmp_path / "class", {**texts, "right": RIGHT})
    words = ("--time-limit", "2", "--memory", "1500", "--only", "pins", "--format", "csv")
    rows = rows_printed(check("class", *words))
    assert {name: row["status"] for name, row in rows.items()} == {
        "its parent": "crashed",
        "its group": "crashed",
        "its line": "crashed",
        "writes into it": "checked",
        "sleeps": "out of time",
        "memory": "out of memory",
        "holds the lock": "out of time",
        "exits": "raised",
        "right": "checked",
    }
    assert rows["right"]["verdict"] == "right"


def has_ended(process):
    """Whether a process runs no more; nobody may have taken note of it."""
    status = Path(f"/proc/{process}/status")
    until = time.monotonic() + 10.0
    while time.monotonic() < until:
        try:
            if "State:\tZ" in status.read_text():
                return True
        except (FileNotFoundError, ProcessLookupError):
            return True
        time.sleep(0.05)
    return False


@pytest.mark.slow
def test_ctrl_c_keeps_what_is_done_and_ends_all_processes(cache, check, tmp_path):
    waits = "import os, time\nopen('/PATH/pid', 'w').write(str(os.getpid()))\ntime.sleep(1000)\n"
    waits = waits.replace("/PATH", str(tmp_path))
    a_class.write(tmp_path / "class", {"a": RIGHT, "b": waits})
    words = ("class", "--only", "pins", "-o", "out")
    process = subprocess.Popen(
        [sys.executable, "-m", "ropeode", "check", *words],
        stderr=subprocess.PIPE,
        text=True,
        cwd=tmp_path,
        env={**os.environ, "XDG_CACHE_HOME": cache},
    )
    pid, done = tmp_path / "pid", tmp_path / "out/results/a.json"
    until = time.monotonic() + HANGS_AFTER_S
    while not (pid.exists() and pid.read_text() and done.exists()) and time.monotonic() < until:
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=HANGS_AFTER_S)
    assert process.returncode == 130
    assert "finished submissions are kept; run the same command to resume" in err
    assert has_ended(int(pid.read_text()))
    before = done.stat().st_mtime_ns
    (tmp_path / "class/b.py").write_text(RIGHT)
    assert check(*words).returncode == 0
    assert done.stat().st_mtime_ns == before
    assert (
        json.loads((tmp_path / "out/results/b.json").read_text())["outcome"]["verdict"] == "right"
    )


@pytest.mark.slow
def test_subfolders_import_what_stands_beside(check, tmp_path):
    for name in ("anna", "bert"):
        folder = tmp_path / "class" / name
        folder.mkdir(parents=True)
        (folder / "helper.py").write_text(f"name = {name!r}\n")
        (folder / "verlet.py").write_text(
            f"import helper\nassert helper.name == {name!r}\nopen('helper.py').close()\n{RIGHT}"
        )
    done = check("class", "--name", "verlet.py:step", "--only", "pins")
    assert done.returncode == 0, done.stdout
    assert "2 submissions: 2 right." in done.stdout
