"""The worker as the server sees it: a process that may hang, die, or grow, and is replaced then."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import signal
import struct
import sys
import time
from asyncio.subprocess import PIPE, Process
from collections.abc import Iterable
from typing import Any, NamedTuple

import psutil

from ropeode.errors import RopeodeError
from ropeode.terminal.supervision import how_it_ended

# In front of each message from the worker.
LENGTH = struct.Struct("<I")
_WORKER = "from ropeode.laboratory.worker import main; main()"
_LOOKS_AGAIN_S = 0.25
# The wall time that is allowed, over the processor time: user's code may wait for something.
_WAITING = 10.0
_MEBIBYTE = 2**20


class Limits(NamedTuple):
    """What a worker may take.

    Fields:
        seconds: of processor time without a sign of life; of wall time ten times as many.
        stops_in: seconds within which it leaves off what nobody wants any more.
        memory: in bytes.
        tidy_memory: with more than this it is replaced as soon as it has nothing to do.
    """

    seconds: float = 20.0
    stops_in: float = 10.0
    memory: float = 4096 * _MEBIBYTE
    tidy_memory: float = 2048 * _MEBIBYTE


class Lost(RopeodeError):
    """The worker is of no use any more; the message says what it did, as of a subject before it."""


class WorkerProcess:
    """A process that answers one question at a time.

    Arguments:
        limits: what it may take.
        words: its arguments, in JSON.
        code: that it runs, in Python.
    """

    def __init__(self, limits: Limits, words: Iterable[Any], code: str = _WORKER) -> None:
        self._limits, self._code = limits, code
        self._words = [json.dumps(word) for word in words]
        # Whether it has imported what it needs.
        self.is_ready = False
        self._process: Process | None = None
        self._stop_sent: float | None = None

    async def start(self) -> None:
        """Start it."""
        # Set before anything is imported: a file in the current folder is not imported by mistake.
        code = f"import sys; sys.path[:] = {sys.path!r}\n{self._code}"
        self._process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-c", code, *self._words),
            stdin=PIPE,
            stdout=PIPE,
            # Ctrl-C is for the server; and what the user's code starts ends with the worker.
            start_new_session=True,
        )

    async def kill(self) -> None:
        """End it at once, with all processes that it started; nothing, if it does not run."""
        process, self._process, self._stop_sent = self._process, None, None
        self.is_ready = False
        if process is not None:
            await _end(process)

    def order(self, **order: Any) -> None:
        """Send an order, as `ropeode.laboratory.worker` reads them."""
        self._stop_sent = time.monotonic() if "stop" in order else None
        process = self._running()
        assert process.stdin is not None
        # The worker reads while it computes, so little waits here.
        process.stdin.write(json.dumps(order).encode() + b"\n")

    async def said(self) -> bytes:
        """The next message.

        Raises:
            Lost: the worker has died, did not say anything for too long, or takes too much
                memory.
        """
        read = asyncio.ensure_future(self._read())
        began = time.monotonic(), self._processor_s()
        try:
            while not read.done():
                await asyncio.wait([read], timeout=_LOOKS_AGAIN_S)
                if not read.done():
                    self._check(*began)
            return read.result()
        finally:
            read.cancel()

    def wants_rest(self) -> bool:
        """Whether it takes more memory than one that has nothing to do should."""
        return self._memory() > self._limits.tidy_memory

    def _running(self) -> Process:
        assert self._process is not None, "the worker was not started"
        return self._process

    async def _read(self) -> bytes:
        process = self._running()
        assert process.stdout is not None
        try:
            (length,) = LENGTH.unpack(await process.stdout.readexactly(LENGTH.size))
            return await process.stdout.readexactly(length)
        except asyncio.IncompleteReadError:
            # It may have closed its output and go on.
            raise Lost(how_it_ended(await _end(process))) from None

    def _check(self, began: float, processor_s: float) -> None:
        limits, now = self._limits, time.monotonic()
        if self._processor_s() - processor_s > limits.seconds:
            raise Lost(f"did not finish within {limits.seconds:g} s of processor time")
        if now - began > _WAITING * limits.seconds:
            raise Lost(f"did not finish within {_WAITING * limits.seconds:g} s")
        if self._stop_sent is not None and now - self._stop_sent > limits.stops_in:
            raise Lost("did not stop when nobody wanted it any more")
        if self._memory() > limits.memory:
            raise Lost(f"needed more than {limits.memory / _MEBIBYTE:.0f} MiB of memory")

    def _processor_s(self) -> float:
        with contextlib.suppress(psutil.Error):
            times = psutil.Process(self._running().pid).cpu_times()
            return times.user + times.system
        return 0.0

    def _memory(self) -> int:
        with contextlib.suppress(psutil.Error):
            return psutil.Process(self._running().pid).memory_info().rss
        return 0


async def _end(process: Process) -> int:
    """The exit code of a process that has ended by now, or is ended."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    if process.stdin is not None:
        process.stdin.close()
    return await process.wait()
