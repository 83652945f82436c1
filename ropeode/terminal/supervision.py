"""A command in a process that another one watches: the user's code may end it, or never return.

What the user's code can do to its process (end it, crash it, hold Python's global lock for good)
it cannot do to the process that watches, which runs none of it.
"""

from __future__ import annotations

import contextlib
import faulthandler
import os
import re
import select
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from typing import NamedTuple, NoReturn

from ropeode.terminal.running import DOES, NOTHING, end_on_ctrl_c, is_users, this

# How often the processes look whether the other one is alive.
_LOOKS_AGAIN_S = 0.25
# The wall time that is allowed without a sign of life, over the processor time.
_WAITING = 10.0
# Between the two processes a shell, so that code which kills its parent kills that.
_SHELL = ("/bin/sh", "-c", '"$@"; exit $?', "ropeode")
_ENDS_BY_SIGNAL = 128
# The signals of the two timers that end a process which does not return.
_HANGS = (signal.SIGPROF, signal.SIGALRM)


# Lines between the two processes begin with one of these.
_ENDS = "="
# With this line begins what Python says there when it crashes: where the thread was.
_CRASH = "Fatal Python error: "


class Ended(NamedTuple):
    """How a watched process ended.

    Fields:
        code: its exit code, where it reached its own end; None where something ended it.
        during: what it was doing; empty where it had not begun.
        how: in words, as of the code that it ran: it "ended its process (exit code 0)".
        crashed: whether it crashed in compiled code that none of the user's Python code called.
    """

    code: int | None
    during: str
    how: str
    crashed: bool = False


def watch(code: str, words: Sequence[str], left: str = NOTHING) -> Ended:
    """Run Python code in a process of its own, until it ends or says that it has.

    Arguments:
        code: calls `watched` with `FD`, the number of a file.
        words: the arguments of the process.
        left: what Ctrl-C leaves, for the message.
    """
    ours, theirs = socket.socketpair()
    start = f"import sys; sys.path[:] = {sys.path!r}; FD = {theirs.fileno()}\n{code}"
    process = subprocess.Popen(
        [*_SHELL, sys.executable, "-c", start, *words],
        stdin=subprocess.DEVNULL,
        pass_fds=[theirs.fileno()],
        # Not in this process group: Ctrl-C is for this process, and kill(0) is not.
        start_new_session=True,
    )

    def end() -> None:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)

    theirs.close()
    end_on_ctrl_c(left, before=end)
    with ours:
        try:
            said = _all_that_is_said(ours, process)
        finally:
            end()
            process.wait()
    doing = [line[1:] for line in said if line.startswith(DOES)]
    codes = [int(line[1:]) for line in said if _is_end(line)]
    return Ended(
        code=codes[-1] if codes else None,
        during=doing[-1] if doing else "",
        how=how_it_ended(process.returncode, shell=True),
        crashed=any(_CRASH in line for line in said) and not any(map(_is_users, said)),
    )


def _is_users(line: str) -> bool:
    """Whether a line of a traceback names a file of the user's."""
    named = re.match(r'  File "(.*)", line ', line)
    return named is not None and is_users(named[1])


def _all_that_is_said(line: socket.socket, process: subprocess.Popen) -> list[str]:
    """The lines that a process says until its last one, or until it ends."""
    said = b""
    while True:
        # Before what it has said is read: it may say more and then end.
        alive = process.poll() is None
        waits_s = _LOOKS_AGAIN_S if alive else 0.0
        readable, _, _ = select.select([line], [], [], waits_s)
        more = line.recv(65536) if readable else b""
        said += more
        # A letter may not have come whole; and the user's code may have written here.
        lines = said.decode(errors="replace").splitlines()
        if (lines and _is_end(lines[-1])) or not (more or alive):
            return lines
        if readable and not more:
            # It can say no more.
            time.sleep(waits_s)


def _is_end(line: str) -> bool:
    return line.startswith(_ENDS) and line[1:].isdecimal()


def how_it_ended(code: int, *, shell: bool = False) -> str:
    """How a process ended, in words.

    Arguments:
        code: its exit code; minus the number of the signal that ended it.
        shell: whether that is the code of the shell around it, which has signals above 128.
    """
    number = -code if code < 0 else code - _ENDS_BY_SIGNAL if shell else 0
    if number in _HANGS:
        return "did not return, and let nothing else run meanwhile"
    with contextlib.suppress(ValueError):
        if code < 0 and shell:
            return f"killed its parent process ({signal.Signals(number).name})"
        return f"ended its process ({signal.Signals(number).name})"
    return f"ended its process (exit code {code})"


def watched(fd: int, command: Callable[[], int]) -> NoReturn:
    """The process that is watched.

    Output goes where it went, but the user's code does not find it by its number: what compiled
    code prints goes to standard error, and the output is there if standard output is closed.

    Arguments:
        fd: the file that it was handed.
        command: is run; it returns the exit code.
    """
    this.line = socket.socket(fileno=fd)
    faulthandler.enable(this.line.fileno(), all_threads=False)
    sys.stdout = os.fdopen(os.dup(1), "w", encoding=sys.stdout.encoding, errors="backslashreplace")
    os.dup2(2, 1)
    # Ctrl-C is for the other process; here it can only be the user's code that sends it.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    threading.Thread(target=_end_with_the_other, args=(this.line,), daemon=True).start()
    code = command()
    sys.stdout.flush()
    with contextlib.suppress(OSError, ValueError):
        sys.stderr.flush()
    # A line of its own, whatever the user's code has written before.
    this.line.sendall(f"\n{_ENDS}{code}\n".encode())
    os._exit(code)


def _end_with_the_other(line: socket.socket) -> None:
    while line.recv(1):
        pass
    os._exit(1)


def end_if_nothing_runs(seconds: float) -> None:
    """Let this process end where Python does not run for so long, if another one watches it.

    Compiled code that holds Python's global lock and does not return cannot be given up.

    Arguments:
        seconds: of processor time; of wall time ten times as many.
    """
    if this.line is not None:
        end_if_python_stops(seconds)


def end_if_python_stops(seconds: float) -> None:
    """Let this process end where Python does not run for so long.

    Arguments:
        seconds: of processor time; of wall time ten times as many.
    """

    def wind_up() -> None:
        while True:
            for timer, after in (
                (signal.ITIMER_PROF, seconds),
                (signal.ITIMER_REAL, _WAITING * seconds),
            ):
                # They count from here on; a signal that nobody handles ends the process.
                signal.setitimer(timer, max(after, 4.0 * _LOOKS_AGAIN_S))
            threading.Event().wait(_LOOKS_AGAIN_S)

    threading.Thread(target=wind_up, daemon=True).start()
