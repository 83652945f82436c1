"""A process that runs the user's code, and what becomes of it, is watched by another one."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time

import pytest

from ropeode.cli import run_command
from ropeode.sandbox import Ended
from ropeode.terminal import show_progress
from tests.time_limit import HANGS_AFTER_S

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
def working(does):
    def work(progress):
        progress("rk4: 16 steps per frame", 0.5)
        does()
    return work
with_progress(working(lambda: time.sleep(1.3)), gives_up_after=1.0)
with_progress(working(lambda: program(computes)), gives_up_after=1.0)
print("done", flush=True)
try:
    with_progress(working(lambda: program(threading.Event().wait)), gives_up_after=1.0)
except RuntimeError as error:
    print(error, flush=True)
os._exit(0)
"""


@pytest.mark.slow
def test_a_program_that_waits_for_ever_ends_the_command():
    command = [sys.executable, "-c", WAITING]
    said = subprocess.run(command, capture_output=True, text=True, timeout=HANGS_AFTER_S).stdout
    done, gave_up = said.splitlines()
    assert done == "done"
    assert "rk4: 16 steps per frame" in gave_up


@pytest.mark.parametrize("form", ["json", "text"])
def test_a_step_that_ends_its_process_has_failed_a_check(form, capsys, command_surroundings):
    ended = Ended(EXIT.format(0), "order-free")
    words = ["check", "mine.py:step", "--order", "2", "--only", "pins,order-free"]
    assert run_command([*words, "--format", form], ended) == 1
    out = capsys.readouterr().out
    if form == "text":
        assert "claimed to be of order 2" in " ".join(out.split())
        assert "Wrong: 1 of 3 checks fails (purity)" in out
        return
    first, *others = json.loads(out)["findings"]
    assert (first["check"], first["status"]) == ("purity", "fail")
    assert "ended its process (exit code 0), during 'order-free'" in first["finding"]
    assert [each["status"] for each in others] == ["skip", "skip"]


CRASHES = """
import ctypes
def step(acceleration, t, x, v, dt, args):
    if t > 1.0: ctypes.string_at(0)
    return x, v
"""


@pytest.mark.slow
def test_a_check_of_such_a_step_as_a_process(run_process, tmp_path):
    (tmp_path / "mine.py").write_text(CRASHES)
    done = run_process("check", "mine.py", "--only", "pins,order-driven", "--format", "json")
    found = {each["check"]: each["status"] for each in json.loads(done.stdout)["findings"]}
    assert done.returncode == 1
    assert found == {"purity": "fail", "order-driven": "skip", "pins": "skip"}


@pytest.mark.slow
def test_output_is_there_though_it_was_closed(run_process, tmp_path):
    (tmp_path / "mine.py").write_text(
        "import os\nos.write(1, b'from compiled code')\nos.close(1)\nstep = 1\n"
    )
    done = run_process("explain", "mine.py", "--format", "json")
    assert (done.returncode, done.stdout) == (2, "")
    assert "from compiled code" in done.stderr
    assert "stepper: " in done.stderr


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
    while not (pid.exists() and pid.read_text()):
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    said = process.communicate(timeout=HANGS_AFTER_S)
    assert (process.returncode, *said) == (130, "", "ropeode: interrupted; nothing was written.\n")
    # It takes a moment until what has ended is gone.
    while os.path.exists(f"/proc/{pid.read_text()}"):
        time.sleep(0.05)


@pytest.mark.slow
@pytest.mark.parametrize("words", ["table --steppers exits.py", "sweep s.toml -o out"])
def test_no_command_ends_silently_with_the_users_code(words, run_process, tmp_path):
    text = "import os\ndef step(rhs, t, y, dt, args): os._exit(0)\n"
    (tmp_path / "exits.py").write_text(text)
    (tmp_path / "s.toml").write_text('steppers = ["exits.py"]\nsteps_per_frame = [16]\n')
    done = run_process(*words.split())
    assert done.returncode == 2
    assert "your code ended its process (exit code 0)" in done.stderr


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
