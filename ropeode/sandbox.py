"""A process for code that may crash, hang, grow, or end whatever it finds.

::

    parent --- guard --- keeper --- child

The *child* runs the code. The *keeper* only waits for it: code that kills its parent, or its
process group, kills the keeper. The *guard* passes on what parent and child say to each other, and
ends all processes below it when the child has ended, when a limit is broken, or when the parent is
gone, however that ended. On Linux it adopts what leaves its parent, its group or its session.

What a child says is bytes that any code may have written. Its messages begin with a token, so that
bytes which do not are skipped; and a caller checks what they hold before it believes them.

This guards against accidents. The code still runs as the user, with their files and network.
"""

from __future__ import annotations

import contextlib
import ctypes
import faulthandler
import io
import json
import os
import pickle
import resource
import select
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
import traceback
from collections import deque
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple, NoReturn

import psutil

from ropeode.errors import RopeodeError

MEBIBYTE = 2**20
# How often limits are looked at, and processes that were killed are waited for.
_LOOK_EVERY_S, _WAIT_S = 0.1, 0.005
# After so long a process that was killed is left to the system, which may wait for a disk.
_ENDS_IN_S = 10.0
# Of messages: bytes of a token, the form of the length, the most that it may be, and how much is
# received at once.
_TOKEN, _LENGTH, _LONGEST, _CHUNK = 16, struct.Struct("<I"), 2**30, 2**18
# How much is kept, in bytes, of what a child does and of what it says that is no message.
_LONGEST_DOING, _LONGEST_NOISE = 200, 2**16
# The kinds of messages: what is being done, words of the caller's, the result, limits, the end.
_DOES, _SAYS, _RETURNS, _LIMITS, _ENDS = b"d", b"s", b"r", b"l", b"e"
# Linux, prctl(2).
_PR_SET_PDEATHSIG, _PR_SET_CHILD_SUBREAPER = 1, 36
# Of the two timers that end a process in which Python does not run. Wall time may be ten times the
# processor time: the code may wait for something.
_HANGS, _WAITING, _WINDS_UP_EVERY_S = (signal.SIGPROF, signal.SIGALRM), 10.0, 0.25


class Limits(NamedTuple):
    """What a child and everything that it starts may use together; None for no limit.

    Fields:
        cpu: processor time in seconds, from when the limit was set.
        wall: wall time, likewise.
        memory: in bytes, at any time.
    """

    cpu: float | None = None
    wall: float | None = None
    memory: float | None = None


NO_LIMITS = Limits()


class Ended(NamedTuple):
    """How a child ended.

    Fields:
        how: in words, as of the code that it ran: it "ended its process (exit code 0)".
        during: what it did last, as it said.
        result: of its function; None where that did not return.
        limit: the field of `Limits` that it broke; empty where it broke none.
        noise: the end of what it wrote on the line that is no message, such as Python's words about
            a crash in compiled code: where the thread was.
    """

    how: str
    during: str = ""
    result: bytes | None = None
    limit: str = ""
    noise: str = ""


class GuardLost(RopeodeError):
    """The guard has ended before its child: it was killed, or was told to."""

    def __init__(self) -> None:
        super().__init__(
            "the process that guards the user's code has ended. Fix: run this again; look for code "
            "that kills other processes."
        )


def run(
    function: Callable[..., bytes],
    *args: Any,
    cpu: float | None = None,
    wall: float | None = None,
    memory: float | None = None,
) -> Ended:
    r"""Call a function in a process of its own, and wait until that has ended.

    Arguments:
        function: that can be imported; what it returns is the `result`.
        args: its arguments, which can be pickled.
        cpu: as in `Limits`, like those that follow.
        wall: likewise.
        memory: likewise.

    Raises:
        GuardLost: something else has ended the guard.

    Examples:
        >>> from ropeode import sandbox
        >>> sandbox.run(bytes, 3).result
        b'\x00\x00\x00'
    """
    with Child(function, *args, limits=Limits(cpu, wall, memory)) as child:
        return child.wait()


class Child(contextlib.AbstractContextManager["Child"]):
    """A process that runs a function, as the parent sees it; it ends with the ``with`` block.

    Arguments:
        function: that can be imported. It may `say` and hear something before it returns bytes.
        args: its arguments, which can be pickled.
        limits: that hold from now on.
        quiet: discard what it prints.
        nursery: that it is forked from; None to start Python anew.

    Attributes:
        during: what it does, as it says.
    """

    def __init__(
        self,
        function: Callable[..., bytes],
        *args: Any,
        limits: Limits = NO_LIMITS,
        quiet: bool = False,
        nursery: Nursery | None = None,
    ) -> None:
        if _this.is_importing_main:
            raise RopeodeError(
                "a process that needs functions of this script runs it again, up to here. Fix: "
                "call this below `if __name__ == '__main__':`"
            )
        self.during = ""
        self._result: bytes | None = None
        self._messages: deque[tuple[bytes, bytes]] = deque()
        ours, theirs = socket.socketpair()
        self._stream = _Stream(ours)
        with theirs:
            self._guard = _start(guard, theirs) if nursery is None else None
            if nursery is not None and not nursery.hand_over(theirs):
                self._stream.close()
                raise GuardLost
        main = getattr(sys.modules["__main__"], "__file__", None)
        self._send(_SAYS, json.dumps([limits, quiet, main]).encode())
        self.send((function, args))

    def send(self, value: Any) -> None:
        """Say something, which can be pickled, that the child hears; nothing where it has ended."""
        self._send(_SAYS, pickle.dumps(value))

    def limit(self, limits: Limits) -> None:
        """Set its limits anew."""
        self._send(_LIMITS, json.dumps(limits).encode())

    def _send(self, kind: bytes, contents: bytes) -> None:
        # Whoever reads is told that it has ended.
        with contextlib.suppress(OSError):
            self._stream.send(kind, contents)

    def read(self) -> bytes | Ended:
        """The next thing that it says, or how it ended; whatever it says, some code has written.

        Raises:
            GuardLost: nobody can tell any more.
        """
        while True:
            while not self._messages:
                self._messages.extend(self._stream.receive())
                if not (self._messages or self._stream.is_open):
                    raise GuardLost
            kind, contents = self._messages.popleft()
            if kind == _DOES:
                self.during = contents[:_LONGEST_DOING].decode(errors="replace")
            elif kind == _RETURNS:
                self._result = contents
            elif kind == _ENDS:
                return Ended(**json.loads(contents), during=self.during, result=self._result)
            else:
                return contents

    def wait(self) -> Ended:
        """How it ended, after everything that it says."""
        while not isinstance(said := self.read(), Ended):
            pass
        return said

    def memory(self) -> int:
        """The memory that it and what it started hold, in bytes; 0 where nobody can tell."""
        below = _below(self._guard.pid) if self._guard else []
        return int(sum(map(_memory, below)))

    def end(self) -> None:
        """End it with everything that it started; nothing where it has ended."""
        self._stream.close()
        if self._guard is not None:
            self._guard.wait()

    def __exit__(self, *_: object) -> None:
        self.end()


class Nursery(contextlib.AbstractContextManager["Nursery"]):
    """A process that has made preparations once, and is forked for each child.

    It runs no user's code and must start no thread: JAX has threads from its first computation on,
    and a process that is forked after that hangs.

    Arguments:
        prepare: is called in it, before the first child; what it registers with `atexit` is
            called at its end.
        args: of that.

    Attributes:
        has_ended: whether it was told to end.
    """

    has_ended = False

    def __init__(self, prepare: Callable[..., object], *args: Any) -> None:
        self._line, theirs = socket.socketpair()
        with theirs:
            self._process = _start(nursery, theirs, pickle.dumps((prepare, args)))

    def hand_over(self, line: socket.socket) -> bool:
        """Have it forked for a child with this line to its parent; False where it has ended."""
        with contextlib.suppress(OSError):
            return bool(socket.send_fds(self._line, [_SAYS], [line.fileno()]))
        return False

    def end(self) -> None:
        """End it with all children; nothing where it has ended."""
        self.has_ended = True
        with contextlib.suppress(OSError):
            self._line.shutdown(socket.SHUT_RDWR)
        self._process.wait()
        self._line.close()

    def __exit__(self, *_: object) -> None:
        self.end()


def _start(
    main: Callable[..., NoReturn], line: socket.socket, *args: bytes
) -> subprocess.Popen[bytes]:
    """Start Python with one of the functions of this module and a line to this process."""
    code = (
        # Before anything is imported: a file in the current folder is not imported by mistake.
        f"import sys; sys.path[:] = {sys.path!r}\n"
        f"from ropeode.sandbox import {main.__name__} as main; main(*{(line.fileno(), *args)!r})"
    )
    return subprocess.Popen(
        [sys.executable, "-c", code],
        stdin=subprocess.DEVNULL,
        pass_fds=[line.fileno()],
        # Ctrl-C is for the parent.
        start_new_session=True,
    )


class _Stream:
    """Messages on a socket: a token, the length, the kind and the contents of each.

    Arguments:
        line: between two processes.
        token: in front of each message; where one of them runs the user's code, which may write
            on the line too, a secret of the two.

    Attributes:
        is_open: whether the other end may send more.
        noise: the end of what was received that is no message.
        rest: what was received after it, and may become one.
    """

    def __init__(self, line: socket.socket, token: bytes = b"") -> None:
        self.line, self.is_open, self.noise = line, True, bytearray()
        self._token, self.rest = token, bytearray()
        # Held while a message is written, which any thread may do.
        self._writing = threading.Lock()

    def send(self, kind: bytes, contents: bytes) -> None:
        """Send a message."""
        with self._writing:
            self.line.sendall(self.packed(kind, contents))

    def packed(self, kind: bytes, contents: bytes) -> bytes:
        """A message as bytes."""
        return b"".join((self._token, _LENGTH.pack(len(contents)), kind, contents))

    def receive(self) -> Iterator[tuple[bytes, bytes]]:
        """Receive some bytes; the messages that are whole by now."""
        try:
            more = self.line.recv(_CHUNK)
        except BlockingIOError:
            return
        except OSError:
            more = b""
        self.is_open = bool(more)
        self.rest += more
        yield from self.whole()

    def whole(self) -> Iterator[tuple[bytes, bytes]]:
        """The messages that were received, and were not taken yet."""
        return iter(self._next, None)

    def messages(self) -> Iterator[tuple[bytes, bytes]]:
        """All messages, one after the other, until the other end sends no more."""
        yield from self.whole()
        while self.is_open:
            yield from self.receive()

    def _next(self) -> tuple[bytes, bytes] | None:
        """Take the first whole message, and set apart what is none."""
        received, token = self.rest, self._token
        head = len(token) + _LENGTH.size + 1
        while (begin := received.find(token)) >= 0:
            self._skip(begin)
            if len(received) < head:
                return None
            end = head + _LENGTH.unpack_from(received, len(token))[0]
            if end > _LONGEST:
                self._skip(len(token))
                continue
            if len(received) < end:
                return None
            kind, contents = bytes(received[head - 1 : head]), bytes(received[head:end])
            del received[:end]
            return kind, contents
        # It may end with the beginning of a token.
        self._skip(max(0, len(received) - len(token)))
        return None

    def _skip(self, count: int) -> None:
        self.noise = (self.noise + self.rest[:count])[-_LONGEST_NOISE:]
        del self.rest[:count]

    def close(self) -> None:
        """Let both ends know that nothing follows; another thread may be receiving."""
        with contextlib.suppress(OSError):
            self.line.shutdown(socket.SHUT_RDWR)
        # Whoever receives holds it open until then.
        self.line.close()


# In the child.


class _This:
    """What this process knows of itself, where it is a child."""

    stream: _Stream | None = None
    doing = ""
    # The script that the parent runs; and whether this process does, which may start children.
    main: str | None = None
    is_importing_main = False


_this = _This()


def is_child() -> bool:
    """Whether this process is a child."""
    return _this.stream is not None


def doing(what: str) -> None:
    """Tell the parent what this process does; nothing where it is no child."""
    if _this.stream is not None and what != _this.doing:
        _this.doing = what
        _this.stream.send(_DOES, what.encode(errors="replace"))


def say(contents: bytes) -> None:
    """Say something to the parent of this process, which is a child."""
    assert _this.stream is not None
    _this.stream.send(_SAYS, contents)


def heard() -> Iterator[Any]:
    """What the parent of this process says, one after the other, until it says no more."""
    assert _this.stream is not None
    return (_FromParent(io.BytesIO(each)).load() for _, each in _this.stream.messages())


class _FromParent(pickle.Unpickler):
    """A value of the parent's; what a child says is never unpickled."""

    def find_class(self, module_name: str, global_name: str, /) -> Any:
        """A function or class; where it is of the parent's script, that is run first.

        It has another name here, so that `if __name__ == "__main__":` holds in the parent alone.
        """
        if module_name == "__main__" and _this.main is not None:
            from multiprocessing import spawn

            main, _this.main, _this.is_importing_main = _this.main, None, True
            spawn.prepare({"init_main_from_path": main})
            _this.is_importing_main = False
        return super().find_class(module_name, global_name)


def end_if_python_stops(seconds: float) -> None:
    """Let this process end where Python does not run for so long; nothing where it is no child.

    Compiled code that holds Python's global lock and does not return cannot be given up.

    Arguments:
        seconds: of processor time; of wall time ten times as many.
    """
    if _this.stream is None:
        return

    def wind_up() -> None:
        while True:
            for timer, after in (
                (signal.ITIMER_PROF, seconds),
                (signal.ITIMER_REAL, _WAITING * seconds),
            ):
                # They count from here on; a signal that nobody handles ends the process.
                signal.setitimer(timer, max(after, 4.0 * _WINDS_UP_EVERY_S))
            threading.Event().wait(_WINDS_UP_EVERY_S)

    threading.Thread(target=wind_up, daemon=True).start()


def _work(stream: _Stream, quiet: bool, main: str | None) -> None:
    """Run the function that the parent names, and hand over its result."""
    for number in (1, 2) if quiet else ():
        os.dup2(os.open(os.devnull, os.O_WRONLY), number)
    # Ctrl-C is for the parent; here it can only be the user's code that sends it.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    faulthandler.enable(stream.line.fileno(), all_threads=False)
    _this.stream, _this.main = stream, main
    function, args = next(heard())
    result = function(*args)
    for output in (sys.stdout, sys.stderr):
        # The user's code may have closed it.
        with contextlib.suppress(OSError, ValueError):
            output.flush()
    # Whoever wanted it may be gone.
    with contextlib.suppress(OSError):
        stream.send(_RETURNS, result)


# In the guard and the keeper.


def nursery(fd: int, preparation: bytes) -> NoReturn:
    """The process of a `Nursery`, with the number of the line to its parent."""
    _adopt_orphans()
    # Guards that have ended are forgotten by themselves.
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    prepare, args = pickle.loads(preparation)
    prepare(*args)
    line = socket.socket(fileno=fd)
    while fds := socket.recv_fds(line, 1, 1)[1]:
        if os.fork() == 0:
            line.close()
            signal.signal(signal.SIGCHLD, signal.SIG_DFL)
            guard(fds[0])
        os.close(fds[0])
    _end_all_below()
    sys.exit()


def guard(fd: int) -> NoReturn:
    """The process that guards one child, with the number of the line to its parent."""
    try:
        _adopt_orphans()
        _Guard(_Stream(socket.socket(fileno=fd))).run()
    except (StopIteration, ConnectionError):
        # The parent has ended before it had said what to run, or was told how that ended.
        pass
    except BaseException:
        traceback.print_exc()
    finally:
        _end_all_below()
        os._exit(0)


class _Guard:
    """Starts a child, and ends it.

    Arguments:
        parent: the line to it.
    """

    def __init__(self, parent: _Stream) -> None:
        self._parent = parent
        limits, quiet, main = json.loads(next(parent.messages())[1])
        ours, theirs = socket.socketpair()
        self._status, status = os.pipe()
        token = os.urandom(_TOKEN)
        self._keeper = os.fork()
        if self._keeper == 0:
            for each in (parent.line.detach(), ours.detach(), self._status):
                os.close(each)
            _keep(lambda: _work(_Stream(theirs, token), quiet, main), status)
        theirs.close()
        os.close(status)
        ours.setblocking(False)
        self._child, self._to_child = _Stream(ours, token), bytearray()
        self._set_limits(Limits(*limits))

    def run(self) -> None:
        """Until the child has ended, or has to."""
        # What came together with the first.
        self._obey(self._parent.whole())
        limit, has_returned, has_ended = "", False, False
        while not (limit or has_returned or has_ended):
            reads = [self._parent.line, self._status, *([self._child.line] * self._child.is_open)]
            writes = [self._child.line] if self._to_child else []
            wait_s = None if self._limits == NO_LIMITS else _LOOK_EVERY_S
            readable, writable, _ = select.select(reads, writes, [], wait_s)
            if self._parent.line in readable:
                self._obey(self._parent.receive())
                if not self._parent.is_open:
                    return
            if writable:
                self._write()
            if self._child.line in readable:
                has_returned = self._hand_on()
            has_ended = self._status in readable
            limit = self._broken_limit()
        how = self._how_it_ended() if has_ended else ""
        _end_all_below()
        while self._child.is_open and not has_returned:
            has_returned = self._hand_on()
        if limit:
            how = _in_words(limit, self._limits)
        elif has_returned:
            # It may have ended before this was seen.
            how = "returned"
        noise = (self._child.noise + self._child.rest).decode(errors="replace")
        ended = {"how": how, "limit": limit, "noise": noise}
        self._parent.send(_ENDS, json.dumps(ended).encode())

    def _obey(self, orders: Iterator[tuple[bytes, bytes]]) -> None:
        for kind, contents in orders:
            if kind == _LIMITS:
                self._set_limits(Limits(*json.loads(contents)))
            else:
                self._to_child += self._child.packed(kind, contents)

    def _write(self) -> None:
        """Pass on what the child takes without waiting for it."""
        try:
            del self._to_child[: self._child.line.send(self._to_child)]
        except BlockingIOError:
            pass
        except OSError:
            self._to_child.clear()

    def _hand_on(self) -> bool:
        """Pass on what the child says; whether its function has returned."""
        for kind, contents in self._child.receive():
            if kind in (_DOES, _SAYS, _RETURNS):
                # Whether the parent is there is seen elsewhere.
                with contextlib.suppress(OSError):
                    self._parent.send(kind, contents)
            if kind == _RETURNS:
                return True
        return False

    def _set_limits(self, limits: Limits) -> None:
        self._limits, self._since, self._look_at = limits, time.monotonic(), 0.0
        self._cpu_before = 0.0 if limits.cpu is None else sum(map(_cpu, self._tree()))

    def _tree(self) -> list[psutil.Process]:
        """The child and what it has started."""
        return [each for each in _below(os.getpid()) if each.pid != self._keeper]

    def _broken_limit(self) -> str:
        """The limit that is broken; empty if none is."""
        (cpu, wall, memory), now = self._limits, time.monotonic()
        if wall is not None and now - self._since > wall:
            return "wall"
        if now < self._look_at or (cpu is None and memory is None):
            return ""
        self._look_at = now + _LOOK_EVERY_S
        tree = self._tree()
        if cpu is not None and sum(map(_cpu, tree)) - self._cpu_before > cpu:
            return "cpu"
        if memory is not None and sum(map(_memory, tree)) > memory:
            # What processes share was counted for each. To do better takes longer.
            return "memory" if sum(map(_exact_memory, tree)) > memory else ""
        return ""

    def _how_it_ended(self) -> str:
        """How the child ended by itself, in words."""
        if status := os.read(self._status, 20):
            number = os.waitstatus_to_exitcode(int(status))
            if -number in _HANGS:
                return "did not return, and let nothing else run meanwhile"
            if number >= 0:
                return f"ended its process (exit code {number})"
            return f"ended its process ({_name_of(-number)})"
        _, status = os.waitpid(self._keeper, 0)
        return f"killed its parent process ({_name_of(os.WTERMSIG(status))})"


def _name_of(number: int) -> str:
    return {each.value: each.name for each in signal.Signals}.get(number, f"signal {number}")


def _in_words(limit: str, limits: Limits) -> str:
    """That a limit was broken."""
    if limit == "memory":
        return f"needed more than {(limits.memory or 0) / MEBIBYTE:.0f} MiB of memory"
    within = f"{limits.cpu:g} s of processor time" if limit == "cpu" else f"{limits.wall:g} s"
    return f"did not finish within {within}"


def _keep(work: Callable[[], None], status: int) -> NoReturn:
    """Run the work in a process below this one, wait for it, and write how that ended.

    Arguments:
        work: what to do there.
        status: the number of a file, to write to.
    """
    os.setsid()
    _die_with_parent()
    child = os.fork()
    if child == 0:
        try:
            os.close(status)
            _die_with_parent()
            work()
            os._exit(0)
        except BaseException:
            traceback.print_exc()
        finally:
            os._exit(1)
    # The child alone holds what it was given, so that its end is seen.
    os.closerange(0, status)
    os.closerange(status + 1, os.sysconf("SC_OPEN_MAX"))
    os.write(status, str(os.waitpid(child, 0)[1]).encode())
    os._exit(0)


def _adopt_orphans() -> None:
    """Be the parent of all processes below this one whose own has ended, where this is Linux."""
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(_PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)


def _die_with_parent() -> None:
    """End when the parent ends, where this is Linux."""
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)


def _end_all_below() -> None:
    """End all processes below this one."""
    until = time.monotonic() + _ENDS_IN_S
    while time.monotonic() < until:
        for each in _below(os.getpid()):
            with contextlib.suppress(psutil.Error):
                each.kill()
        try:
            while os.waitpid(-1, os.WNOHANG)[0]:
                pass
        except ChildProcessError:
            return
        time.sleep(_WAIT_S)


# What the system knows of processes. Each may end at any moment.


def _below(root: int) -> list[psutil.Process]:
    """What a process has started, and what that has started."""
    with contextlib.suppress(psutil.Error):
        return psutil.Process(root).children(recursive=True)
    return []


def _cpu(process: psutil.Process) -> float:
    """Seconds of processor time, with that of its children which have ended."""
    with contextlib.suppress(psutil.Error):
        return sum(process.cpu_times()[:4])
    return 0.0


def _memory(process: psutil.Process) -> float:
    """The memory that a process holds, in bytes, shared or not."""
    with contextlib.suppress(psutil.Error):
        return process.memory_info().rss
    return 0.0


def _exact_memory(process: psutil.Process) -> float:
    """Its memory, with a share of what it shares; all of that where the system does not tell."""
    # Only Linux knows the field.
    with contextlib.suppress(psutil.Error, AttributeError):
        return process.memory_full_info().pss
    return _memory(process)
