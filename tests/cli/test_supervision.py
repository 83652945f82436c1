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
from ropeode.terminal import Ended, show_progress, watch
from tests.time_limit import HANGS_AFTER_S

# Of a process that says what it does, and then runs this.
BEGINS = """
import ctypes, os, signal, sys, threading, time
from ropeode.terminal import end_if_nothing_runs, say, watched
def command():
    say("the trial")
    say("pins")
    end_if_nothing_runs(0.1)
    {}
    return 5
watched(FD, command)
"""
EXIT = "ended its process (exit code {})"


@pytest.mark.parametrize(
    ("does", "code", "how"),
    [
        ("pass", 5, ""),
        ("os._exit(0)", None, EXIT.format(0)),
        ("threading.Thread(target=lambda: os._exit(0)).start(); time.sleep(9)", None, "code 0"),
        ("ctypes.string_at(0)", None, "ended its process (SIGSEGV)"),
        ("os.kill(os.getpid(), signal.SIGINT); time.sleep(9)", None, "SIGINT"),
        ("os.kill(os.getppid(), signal.SIGKILL); time.sleep(9)", None, "killed its parent"),
        ("os.kill(0, signal.SIGTERM); time.sleep(9)", None, "killed its parent"),
        ("sum(range(10**15))", None, "did not return"),
        ("os.closerange(0, 100); time.sleep(0.1)", None, "ended its process"),
        ("os.close(1); sys.stdout.write('')", 5, ""),
        # Half a line, and no letters.
        ("os.write(FD, b'\\xff\\n=x\\n=')", 5, ""),
        # The process does not wait for what still computes in it.
        ("threading.Thread(target=time.sleep, args=(99,)).start()", 5, ""),
    ],
)
def test_what_ends_a_process_is_seen_by_another_one(does, code, how):
    before = signal.getsignal(signal.SIGINT)
    try:
        ended = watch(BEGINS.format(does), [])
    finally:
        signal.signal(signal.SIGINT, before)
    assert (ended.code, ended.during) == (code, "pins")
    assert how in ended.how


@pytest.mark.parametrize("users", [True, False])
def test_a_crash_is_the_users_where_their_code_ran(users, tmp_path):
    (tmp_path / "mine.py").write_text("import ctypes\ndef step():\n    ctypes.string_at(0)\n")
    calls = f"sys.path[:0] = [{str(tmp_path)!r}]; import mine; mine.step()"
    before = signal.getsignal(signal.SIGINT)
    try:
        ended = watch(BEGINS.format(calls if users else "ctypes.string_at(0)"), [])
    finally:
        signal.signal(signal.SIGINT, before)
    assert (ended.code, ended.crashed) == (None, not users)


@pytest.mark.parametrize(
    ("command", "ended", "code", "says"),
    [
        ("check", Ended(None, "pins", "ended its process (SIGSEGV)", crashed=True), 3, "pins"),
        ("table", Ended(None, "pins", "ended its process (SIGSEGV)", crashed=True), 3, "SIGSEGV"),
        ("check", Ended(None, "", EXIT.format(0)), 3, "before it began"),
        ("table", Ended(None, "a step", EXIT.format(0)), 2, "your code ended its process (exit"),
    ],
)
def test_a_crash_of_other_code_is_no_verdict(command, ended, code, says, capsys):
    assert run_command([command, "mine.py"], ended) == code
    said = capsys.readouterr().err
    assert says in said
    assert ("your code ended" in said) == (code == 2)


# Of a command that waits for a program, which waits for what `how` says; its own files are not the
# user's.
WAITS = """
import os, sys, threading, time
import jax
from ropeode.terminal import with_progress
def work(progress):
    progress("rk4: 16 steps per frame", 0.5)
    {}
try:
    with_progress(work, gives_up_after=1.0)
except RuntimeError as error:
    print(error, flush=True)
os._exit(0)
"""
PROGRAM = "jax.block_until_ready(jax.jit(lambda: jax.pure_callback({}, jax.numpy.ones(())))())"


@pytest.mark.parametrize(
    ("does", "ends"),
    [
        (PROGRAM.format("lambda: threading.Event().wait()"), True),
        (PROGRAM.format("lambda: sum(range(6 * 10**7)) * 0.0"), False),
        ("time.sleep(2.0)", False),
    ],
    ids=["a program that waits", "a program that computes", "no program"],
)
def test_a_program_that_waits_for_ever_ends_the_command(does, ends):
    command = [sys.executable, "-c", WAITS.format(does)]
    said = subprocess.run(command, capture_output=True, text=True, timeout=HANGS_AFTER_S).stdout
    assert ("rk4: 16 steps per frame" in said) == ends


def test_output_is_there_though_it_was_closed(capfd):
    before = signal.getsignal(signal.SIGINT)
    watch(BEGINS.format("os.write(1, b'from compiled code'); os.close(1); print('report')"), [])
    signal.signal(signal.SIGINT, before)
    out, err = capfd.readouterr()
    assert (out, "from compiled code" in err) == ("report\n", True)


@pytest.mark.parametrize("form", ["json", "text"])
def test_a_step_that_ends_its_process_has_failed_a_check(form, capsys, command_surroundings):
    ended = Ended(None, "order-free", EXIT.format(0))
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


@pytest.mark.slow
@pytest.mark.parametrize("does", ["os._exit(0)", "ctypes.string_at(0)"])
def test_a_check_of_such_a_step_as_a_process(does, run_process, tmp_path):
    (tmp_path / "mine.py").write_text(
        "import ctypes, os\n"
        "def step(acceleration, t, x, v, dt, args):\n"
        f"    if t > 1.0: {does}\n"
        "    v = v + dt * acceleration(t, x, v, args)\n"
        "    return x + dt * v, v\n"
    )
    done = run_process("check", "mine.py", "--only", "pins,order-driven", "--format", "json")
    found = {each["check"]: each["status"] for each in json.loads(done.stdout)["findings"]}
    assert done.returncode == 1
    assert found == {"purity": "fail", "order-driven": "skip", "pins": "skip"}


@pytest.mark.slow
def test_ctrl_c_ends_both_processes(environment, tmp_path):
    (tmp_path / "mine.py").write_text(
        "import os, pathlib\n"
        "def step(rhs, t, y, dt, args):\n"
        "    pathlib.Path('pid').write_text(str(os.getpid()))\n"
        "    while True: pass\n"
    )
    process = subprocess.Popen(
        [sys.executable, "-m", "ropeode", "check", "mine.py"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=tmp_path,
        env=environment,
    )
    pid = tmp_path / "pid"
    while not (pid.exists() and pid.read_text()):
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    said = process.communicate(timeout=HANGS_AFTER_S)
    assert (process.returncode, *said) == (130, "", "ropeode: interrupted; nothing was written.\n")
    # It takes a moment until what has ended is gone.
    while os.path.exists(f"/proc/{pid.read_text()}"):
        time.sleep(0.05)


@pytest.mark.slow
@pytest.mark.parametrize("words", ["explain exits.py", "table --steppers exits.py", "sweep s.toml"])
def test_no_command_ends_silently_with_the_users_code(words, tmp_path):
    (tmp_path / "exits.py").write_text(
        "import os\n\n\ndef step(rhs, t, y, dt, args):\n    os._exit(0)\n"
    )
    (tmp_path / "s.toml").write_text('steppers = ["exits.py"]\nsteps_per_frame = [16]\n')
    rest = ["-o", "out"] if words.startswith("sweep") else []
    command = [sys.executable, "-m", "ropeode", *words.split(), *rest]
    ended = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert ended.returncode == 2
    assert "your code ended its process (exit code 0)" in ended.stderr


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
