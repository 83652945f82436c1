"""What code does to its process reaches no other one: it is seen, limited, and ended."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

from ropeode import sandbox
from ropeode.sandbox import MEBIBYTE, Child, Ended, GuardLost, Limits, Nursery, run
from tests.time_limit import HANGS_AFTER_S, until

EXIT = "ended its process (exit code {})"
LINUX = pytest.mark.skipif(sys.platform != "linux", reason="other systems leave orphans alone")


def runs(code):
    """In the child: says what it does, and then runs code, which returns or not."""
    sandbox.doing("the trial")
    sandbox.doing("pins")
    exec(f"import ctypes, os, signal, sys, threading, time\n{code}", {"sandbox": sandbox})
    return b"5"


@pytest.mark.parametrize(
    ("code", "result", "how"),
    [
        ("pass", b"5", "returned"),
        ("os._exit(0)", None, EXIT.format(0)),
        ("threading.Thread(target=lambda: os._exit(0)).start(); time.sleep(9)", None, "code 0"),
        ("raise SystemExit(0)", None, EXIT.format(1)),
        ("ctypes.string_at(0)", None, "ended its process (SIGSEGV)"),
        ("os.kill(os.getpid(), signal.SIGINT); time.sleep(9)", None, "SIGINT"),
        ("os.kill(os.getpid(), 35); time.sleep(9)", None, "(signal 35)"),
        ("os.kill(os.getppid(), signal.SIGKILL); time.sleep(9)", None, "killed its parent"),
        ("os.kill(0, signal.SIGTERM); time.sleep(9)", None, "killed its parent"),
        ("sandbox.end_if_python_stops(0.1); sum(range(10**15))", None, "did not return"),
        ("os.closerange(0, 100); time.sleep(0.1)", None, "ended its process"),
        # Half a message, and no letters; and half a message of the line's own.
        ("for n in range(3, 9):\n try: os.write(n, b'\\xff\\n')\n except OSError: pass", b"5", ""),
        (
            "line = sandbox._this.stream\n"
            "line.line.sendall(line.packed(b'r', b'x')[:-1])\nos._exit(7)",
            *(None, EXIT.format(7)),
        ),
        ("line = sandbox._this.stream\nline.line.sendall(line._token + b'\\xff' * 5)", b"5", ""),
        # Nobody waits for what still computes in it, and for what it leaves.
        ("threading.Thread(target=time.sleep, args=(99,)).start()", b"5", ""),
        ("if os.fork() == 0:\n os.setsid()\n time.sleep(1000)", b"5", ""),
        ("sandbox.say(b'much' * 10**6)", b"5", ""),
    ],
)
def test_whatever_ends_a_process_is_told(code, result, how):
    ended = run(runs, code)
    assert (ended.result, ended.during, ended.limit) == (result, "pins", "")
    assert how in ended.how


def says_and_returns():
    sandbox.say(b"here")
    time.sleep(0.3)
    return b"5"


def test_what_has_returned_and_ended_has_returned():
    """On a busy machine both are seen at once."""
    with Child(says_and_returns) as child:
        assert child.read() == b"here"
        (guard,) = (each for each in psutil.Process().children() if "guard" in each.cmdline()[2])
        guard.suspend()
        time.sleep(0.5)
        guard.resume()
        assert child.wait().how == "returned"


@pytest.mark.parametrize(
    ("limit", "code", "how"),
    [
        ({"cpu": 0.5}, "os.fork(); os.fork()\nwhile True: pass", "within 0.5 s of processor time"),
        ({"wall": 0.5}, "time.sleep(1000)", "did not finish within 0.5 s"),
        ({"memory": 2**28}, "if not os.fork(): x = bytearray(2**29)\ntime.sleep(99)", "256 MiB of"),
    ],
)
def test_limits_are_those_of_all_that_it_starts(limit, code, how):
    ended = run(runs, code, **limit)
    assert how in ended.how
    assert ended.limit in limit


def test_a_crash_says_where():
    noise = run(runs, "ctypes.string_at(0)").noise
    for said in ("Fatal Python error: Segmentation fault", 'File "<string>"', "test_sandbox.py"):
        assert said in noise


# What is left is an orphan in a session of its own.
LEAVES = """
if os.fork() == 0:
    os.setsid()
    if os.fork() == 0:
        os.symlink(str(os.getpid()), {file!r})
        time.sleep(1000)
    os._exit(0)
while not os.path.lexists({file!r}): time.sleep(0.01)
"""


@LINUX
@pytest.mark.parametrize("rest", ["", "os._exit(7)", "os.kill(os.getppid(), signal.SIGKILL)"])
def test_nothing_that_it_started_outlives_it(rest, tmp_path):
    file = str(tmp_path / "pid")
    run(runs, LEAVES.format(file=file) + rest)
    assert not os.path.exists(f"/proc/{os.readlink(file)}")


@LINUX
def test_it_ends_with_its_parent_however_that_ends(tmp_path):
    file = str(tmp_path / "pid")
    code = LEAVES.format(file=file) + "time.sleep(1000)"
    parent = f"from tests.test_sandbox import *\nrun(runs, {code!r})"
    root = Path(__file__).parents[1]
    with subprocess.Popen([sys.executable, "-c", parent], cwd=root) as process:
        until(lambda: os.path.lexists(file))
        process.kill()
    until(lambda: not os.path.exists(f"/proc/{os.readlink(file)}"))


def answers():
    """In the child: says the square of each number that it hears."""
    for number in sandbox.heard():
        if number == 3:
            time.sleep(1000)
        sandbox.say(str(number**2).encode())
    return b""


def test_a_conversation_has_a_limit_for_each_answer():
    with Child(answers) as child:
        for number in (1, 2):
            child.limit(Limits(cpu=60.0, wall=60.0))
            child.send(number)
            assert child.read() == str(number**2).encode()
        assert 0 < child.memory() < 2000 * MEBIBYTE
        child.limit(Limits(wall=0.3))
        child.send(3)
        ended = child.read()
    assert isinstance(ended, Ended)
    assert (ended.limit, ended.how) == ("wall", "did not finish within 0.3 s")
    # What has ended is not heard any more, and hears nothing.
    child.send(4)
    with pytest.raises(GuardLost, match=r"the process that guards the user's code has ended\. Fix"):
        child.read()


def prepare(folder):
    """In the nursery."""
    os.environ["PREPARED"] = folder


def looks():
    """In the child: what was prepared, and what another one has done."""
    found, os.environ["PREPARED"] = os.environ["PREPARED"], "spoilt"
    return found.encode()


def test_a_nursery_prepares_once_and_children_share_nothing_else():
    with Nursery(prepare, "here") as nursery:
        for _ in range(2):
            with Child(looks, nursery=nursery) as child:
                assert child.wait().result == b"here"
    with pytest.raises(GuardLost):
        Child(looks, nursery=nursery)


def test_what_the_user_sends_to_a_process_group_is_for_the_parent_alone():
    before = signal.signal(signal.SIGINT, lambda *_: None)
    try:
        with Child(answers) as child:
            os.kill(os.getpid(), signal.SIGINT)
            child.send(5)
            assert child.read() == b"25"
    finally:
        signal.signal(signal.SIGINT, before)


SCRIPT = """
from ropeode import sandbox
def mine():
    return b"of the script"
{guard}:
    print(sandbox.run(mine).result, flush=True)
"""


@pytest.mark.parametrize(
    ("guard", "says"),
    [
        ("if __name__ == '__main__'", "b'of the script'"),
        ("if True", "Fix: call this below `if __name__ == '__main__':`"),
    ],
)
def test_functions_of_a_script_are_found(guard, says, tmp_path):
    (tmp_path / "script.py").write_text(SCRIPT.format(guard=guard))
    command = [sys.executable, "script.py"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, timeout=HANGS_AFTER_S)
    assert says in (done.stdout + done.stderr).decode()
