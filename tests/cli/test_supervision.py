"""A process that runs the user's code, and what becomes of it, is watched by another one."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import time

import pytest

from ropeode.cli import run_command
from ropeode.sandbox import Ended
from ropeode.terminal import show_progress
from tests.cli.conftest import interrupted
from tests.time_limit import HANGS_AFTER_S, until

SEGV, EXIT = "ended its process (SIGSEGV)", "ended its process (exit code {})"
CRASH = 'Fatal Python error: Segmentation fault\n\n  File "{}", line 3 in step\n'


@pytest.mark.parametrize(
    ("command", "ended", "code", "says"),
    [
        ("check", Ended(SEGV, "pins", noise=CRASH.format(json.__file__)), 3, "pins"),
        ("table", Ended(SEGV, "pins", noise=CRASH.format(json.__file__)), 3, "SIGSEGV"),
        ("table", Ended(SEGV, "pins", noise=CRASH.format("/home/me/mine.py")), 2, "SIGSEGV"),
        ("check", Ended(EXIT.format(0)), 3, "before it began"),
        ("table", Ended(EXIT.format(0), "a step"), 2, "your code ended its process (exit"),
    ],
)
def test_a_crash_of_other_code_is_no_verdict(command, ended, code, says, capsys):
    assert run_command([command, "mine.py"], ended) == code
    said = capsys.readouterr().err
    assert says in said
    assert ("your code ended" in said) == (code == 2)


# Commands that wait for a program, which computes, or waits for ever; their own files are not the
# user's.
WAITING = """
import os, threading, time
import jax
from ropeode.terminal import with_progress
def program(does):
    jax.block_until_ready(jax.jit(lambda: jax.pure_callback(does, jax.numpy.ones(())))())
def computes():
    end = time.process_time() + 1.3
    while time.process_time() < end: pass
    return 0.0
waits = threading.Event().wait
def working(does):
    def work(progress):
        progress("rk4: 16 steps per frame", 0.5)
        does()
    return work
for does in (lambda: time.sleep(1.3), lambda: program(computes), lambda: program(waits)):
    try:
        print(with_progress(working(does), gives_up_after=1.0), flush=True)
    except RuntimeError as error:
        print(error, flush=True)
os._exit(0)
"""


@pytest.mark.slow
def test_a_program_that_waits_for_ever_ends_the_command():
    command = [sys.executable, "-c", WAITING]
    said = subprocess.run(command, capture_output=True, text=True, timeout=HANGS_AFTER_S).stdout
    slept, computed, gave_up = said.splitlines()
    assert slept == computed == "None"
    assert "rk4: 16 steps per frame" in gave_up


def test_a_step_that_ends_its_process_has_failed_a_check(capsys, command_surroundings):
    ended = Ended(EXIT.format(0), "order-free")
    words = "check mine.py:step --order 2 --only pins,order-free --format json"
    assert run_command(words.split(), ended) == 1
    first, *others = json.loads(capsys.readouterr().out)["findings"]
    assert (first["check"], first["status"]) == ("purity", "fail")
    assert "ended its process (exit code 0), during 'order-free'" in first["finding"]
    assert [each["status"] for each in others] == ["skip", "skip"]


DIES = """
import ctypes, os
def crashes(acceleration, t, x, v, dt, args):
    if t > 1.0: ctypes.string_at(0)
    return x, v
def exits(rhs, t, y, dt, args): os._exit(0)
"""
CLOSES = "import os\nos.write(1, b'from compiled code')\nos.close(1)\nstep = 1\n"
ENDED = r"your code ended its process \(exit code 0\)"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "code", "out", "error"),
    [
        ("check dies.py:crashes --only pins,order-driven", 1, r"WRONG +purity .*SIGSEGV", ""),
        ("explain closes.py --format json", 2, "^$", "(?=.*from compiled code).*stepper: "),
        ("table --steppers dies.py:exits", 2, "", ENDED),
        ("sweep s.toml -o out", 2, "", ENDED),
    ],
)
def test_no_command_ends_silently_with_the_users_code(
    words, code, out, error, run_process, tmp_path
):
    (tmp_path / "dies.py").write_text(DIES)
    (tmp_path / "closes.py").write_text(CLOSES)
    (tmp_path / "s.toml").write_text('steppers = ["dies.py:exits"]\nsteps_per_frame = [16]\n')
    done = run_process(*words.split())
    assert done.returncode == code
    assert re.search(out, done.stdout, re.S), done.stdout
    assert re.search(error, done.stderr, re.S), done.stderr


ENDLESS = """
import os, pathlib
def step(rhs, t, y, dt, args):
    pathlib.Path("pid").write_text(str(os.getpid()))
    while True: pass
"""


@pytest.mark.slow
def test_ctrl_c_ends_both_processes(started, tmp_path):
    (tmp_path / "mine.py").write_text(ENDLESS)
    process, pid = started("check", "mine.py"), tmp_path / "pid"
    until(lambda: pid.exists() and pid.read_text())
    assert interrupted(process) == ("", "ropeode: interrupted; nothing was written.\n", 130)
    # It takes a moment until what has ended is gone.
    until(lambda: not os.path.exists(f"/proc/{pid.read_text()}"))


def test_progress_in_a_file_is_a_line_now_and_then(monkeypatch, capsys):
    now = iter([0.0, 10.0, 29.9, 40.0, 50.0, 70.0, 200.0])
    monkeypatch.setattr(time, "monotonic", lambda: next(now))
    with show_progress() as progress:
        progress("50 of 100 cases", 0.5)
        progress("too early", 0.55)
        progress("60 of 100 cases", 0.6)
        progress("too early", 0.65)
        progress("70 of 100 cases", 0.7)
        progress("summing up", None)
    assert capsys.readouterr().err.splitlines() == [
        "ropeode: 60 of 100 cases, 0:02:40 left",
        "ropeode: 70 of 100 cases, 0:01:45 left",
        "ropeode: summing up",
    ]
