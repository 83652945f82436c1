"""Submissions that crash, hang, print or copy: each has its row, and none disturbs another."""

from __future__ import annotations

import contextlib
import json
import signal
import time

import psutil
import pytest

from tests.classroom.conftest import rows_in, times, write
from tests.time_limit import HANGS_AFTER_S

STEP = "def step(acceleration, t, x, v, dt, args):\n"
RIGHT = f"{STEP}    v = v + dt * acceleration(t, x, v, args)\n    return x + dt * v, v\n"
# With another name for everything, and another comment.
COPIED = """
def step(acceleration, time, position, velocity, h, parameters):
    # my own work
    new = velocity + h * acceleration(time, position, velocity, parameters)
    return position + h * new, new
"""
PRINTS = RIGHT.replace("    v", "    print('position', x, 'velocity', v)\n    v")
WRONG = f"{STEP}    return x + dt * v, v + 1.001 * dt * acceleration(t, x, v, args)\n"
IMPORTS = f"import helper\nassert helper.name == '%s'\nopen('helper.py').close()\n{RIGHT}"
CRASHES = f"import ctypes\n{STEP}    ctypes.string_at(0)\n"
BORROWS = "from ropeode import as_stepper\nstep = as_stepper('semi-implicit-euler')\n"
SYNTAX, OTHER = RIGHT.replace(":", "", 1), RIGHT.replace("step", "other")
HANGS = f"{STEP}    while True: pass\n"
# By its file: the text; and status, verdict, points, and the beginning of the message.
CLASS = {
    "borrows.py": (BORROWS, "checked", "right", "10", ""),
    "copied.py": (COPIED, "checked", "right", "10", ""),
    "crashes.py": (CRASHES, "crashed", "wrong", "0", "purity: the step ended its process (SIGSEGV"),
    "empty.py": ("", "no stepper", "", "0", "stepper: 'empty.py:step' given"),
    "hangs.py": (HANGS, "out of time", "", "0", "step: a trial of a few steps did not finish with"),
    "other.py": (OTHER, "no stepper", "", "0", "name in other.py: 'step' given"),
    "prints.py": (PRINTS, "checked", "right", "10", ""),
    "right.py": (RIGHT, "checked", "right", "10", ""),
    "syntax.py": (SYNTAX, "syntax error", "", "0", "stepper: the file syntax.py: it raised Syntax"),
    "wrong.py": (WRONG, "checked", "wrong", "4", "at dt = 0 the step solves another equation"),
    # Each imports what stands beside it.
    "zoe/mine.py": (IMPORTS % "zoe", "checked", "right", "10", ""),
    "zora/mine.py": (IMPORTS % "zora", "checked", "right", "10", ""),
}


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("check right.py --name step", "name: 'step' given; allowed: none but with a FOLDER"),
        ("check right.py --memory 100", "memory: '100' given"),
        ("check none --rubric x.toml", "rubric: 'x.toml' given"),
        ("check . --rubric bad.toml", "rubric: item[1].points: 'many' given"),
        ("check . -o right.py", "out: 'right.py' given"),
        ("check . -o .", "out: '.' given; allowed: another folder"),
        ("check . --no-code", "allowed: no Python file, with --no-code"),
        ("check . --only pin", "check: 'pin' given"),
        ("grade . --problem rope --format html", "allowed: text, csv, json, of a FOLDER"),
        ("grade . --problem rope -o .", "out: '.' given; allowed: another folder"),
        ("grade a/16.csv --problem rope --memory 9", "memory: '9' given"),
        ("grade . --problem rope --method rk5", "rk5"),
        ("grade a --problem rope", "files: 'a' given"),
        ("grade .", "problem: 'none' given"),
    ],
)
def test_options_that_cannot_be_used(run, tmp_path, monkeypatch, words, says):
    monkeypatch.setenv("ROPEODE_NO_CODE", "")
    bad = '[[item]]\nname = "a"\npoints = "many"\n'
    write(tmp_path, {"right.py": RIGHT, "a/16.csv": "", "bad.toml": bad})
    done = run(*words.split())
    assert (done.returncode, done.stdout) == (2, "")
    assert says in done.stderr


@pytest.mark.slow
def test_each_submission_has_its_row_and_is_not_checked_again(run_process, tmp_path):
    write(tmp_path / "class", {name: text for name, (text, *_) in CLASS.items()})
    write(tmp_path / "class", {f"{n}/helper.py": f"name = {n!r}\n" for n in ("zoe", "zora")})
    limits = ("--time-limit", "3", "--memory", "1500")
    words = ("check", "class", "--name", "mine.py:step", "--order", "1", *limits, "-o", "out")
    done = run_process(*words)
    # What submissions print is nowhere.
    assert (done.returncode, done.stdout) == (2, "")
    rows = rows_in(tmp_path / "out")
    assert len(rows) == len(CLASS)
    for file, (_, status, verdict, points, message) in CLASS.items():
        name = file.partition("/")[0].removesuffix(".py")
        row = rows[name]
        assert (row["status"], row["verdict"], row["points"]) == (status, verdict, points), row
        assert row["message"].startswith(message), row
        assert (tmp_path / f"out/feedback/{name}.html").is_file()
    assert rows["right"]["marks"] == "same as borrows, copied, prints, zoe, zora"
    assert rows["borrows"]["marks"].endswith("; imports as_stepper of ropeode")
    assert rows["wrong"]["marks"] == ""
    assert "the acceleration is 0.1% too large" in (tmp_path / "out/feedback/wrong.md").read_text()
    assert "SyntaxError: expected ':'" in (tmp_path / "out/feedback/syntax.md").read_text()

    write(tmp_path / "class", {"empty.py": RIGHT})
    before = times(tmp_path / "out/results")
    run_process(*words)
    after = times(tmp_path / "out/results")
    assert before.keys() == after.keys()
    assert {name for name, _ in before.items() ^ after.items()} == {"empty.json"}
    assert rows_in(tmp_path / "out")["empty"]["points"] == "10"


def has_ended(process):
    """Whether a process runs no more; nobody may have taken note of it."""
    with contextlib.suppress(psutil.NoSuchProcess):
        return psutil.Process(process).status() == psutil.STATUS_ZOMBIE
    return True


@pytest.mark.slow
def test_ctrl_c_keeps_what_is_done_and_ends_all_processes(started, run_process, tmp_path):
    pid, done = tmp_path / "pid", tmp_path / "out/results/a.json"
    waits = f"import os, time\nopen({str(pid)!r}, 'w').write(str(os.getpid()))\ntime.sleep(1000)\n"
    write(tmp_path / "class", {"a.py": RIGHT, "b.py": waits})
    words = ("check", "class", "--only", "pins", "-o", "out")
    process = started(*words)
    until = time.monotonic() + HANGS_AFTER_S
    while not (pid.exists() and pid.read_text() and done.exists()) and time.monotonic() < until:
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=HANGS_AFTER_S)
    assert process.returncode == 130
    assert "finished submissions are kept; run the same command to resume" in err
    until = time.monotonic() + 10.0
    while not has_ended(int(pid.read_text())) and time.monotonic() < until:
        time.sleep(0.05)
    assert has_ended(int(pid.read_text()))
    before = times(done.parent)["a.json"]
    write(tmp_path / "class", {"b.py": RIGHT})
    assert run_process(*words).returncode == 0
    assert times(done.parent)["a.json"] == before
    other = json.loads((tmp_path / "out/results/b.json").read_text())
    assert other["outcome"]["verdict"] == "right"
