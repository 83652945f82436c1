"""The time that a thread spends in the user's code, apart from what ropeode does around it.

Compiling, references and fits take time of their own, and on a busy machine everything takes
longer. So a time limit for the user's code counts the processor time of its thread, and only
while that code runs.
"""

from __future__ import annotations

import contextlib
import ctypes
import functools
import math
import os
import threading
import time
import weakref
from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

T = TypeVar("T")


class TimeIsUp(BaseException):
    """Raised inside the user's code; not an `Exception`, which it might catch."""


class Spent(NamedTuple):
    """Seconds that were spent in the user's code.

    Fields:
        processor: computing.
        wall: from beginning to end, waiting included, but not waiting for a processor where the
            system counts that: on a busy machine it is no fault of the code.
    """

    processor: float
    wall: float


class UserClock:
    """Runs while the thread that made it is in the user's code; another thread reads it.

    Arguments:
        limit: processor time that the code may take, in seconds; whoever reads the clock ends it.
    """

    def __init__(self, limit: float = math.inf) -> None:
        self.limit = limit
        self._thread = threading.get_ident()
        self._processor_time = _clock_of(self._thread)
        self._queued: int | None = None
        # Not there on other systems. It stays open: it is read before and behind each step.
        with contextlib.suppress(OSError):
            self._queued = os.open(
                f"/proc/self/task/{threading.get_native_id()}/schedstat", os.O_RDONLY
            )
            weakref.finalize(self, os.close, self._queued)
        # Held while the clock is stopped and while it is read: an interruption reaches the
        # user's code and nothing behind it.
        self._lock = threading.Lock()
        self._before = Spent(0.0, 0.0)
        self._began: Spent | None = None
        self._is_up = False
        self._waited = 0.0
        self._made = self._now()
        _own.clock = self

    def _now(self) -> Spent:
        return Spent(self._processor_time(), time.monotonic() - self._queued_time())

    def _queued_time(self) -> float:
        """The time that the thread was ready to run and did not; 0 where nobody counts it."""
        # The thread may have ended meanwhile.
        with contextlib.suppress(OSError, IndexError, ValueError):
            if self._queued is not None:
                # Linux, Documentation/scheduler/sched-stats.rst: nanoseconds in the second place.
                self._waited = 1e-9 * int(os.pread(self._queued, 128, 0).split()[1])
        return self._waited

    def run(self, function: Callable[..., T], *args: Any) -> T:
        """Call a function of the user's while the clock runs."""
        if self._began is not None:
            return function(*args)
        if self._is_up:
            raise TimeIsUp
        self._began = self._now()
        try:
            return function(*args)
        finally:
            self._stop()

    def _stop(self) -> None:
        with self._lock:
            self._before, self._began = self._spent(), None
        if self._is_up:
            # It may still be on its way.
            _raise_in(self._thread, None)
            raise TimeIsUp

    def _spent(self) -> Spent:
        if self._began is None:
            return self._before
        parts = zip(self._before, self._now(), self._began, strict=True)
        return Spent(*(before + now - began for before, now, began in parts))

    def spent(self) -> Spent:
        """What was spent so far."""
        with self._lock:
            return self._spent()

    def age(self) -> float:
        """The wall time since it was made, but without waiting for a processor."""
        # Not `_now`: a thread that has ended has no processor time any more.
        return time.monotonic() - self._queued_time() - self._made.wall

    def interrupt(self) -> None:
        """Raise `TimeIsUp` in the user's code: at its next line of Python, or when it begins."""
        with self._lock:
            self._is_up = True
            if self._began is not None:
                _raise_in(self._thread, TimeIsUp)


class _Own(threading.local):
    """A thread's own clock, if it has one."""

    clock: UserClock | None = None


_own = _Own()


def on_user_clock(function: Callable[..., T], *args: Any) -> T:
    """Call a function of the user's; where its thread has a clock, that runs meanwhile."""
    clock = _own.clock
    return function(*args) if clock is None else clock.run(function, *args)


def user_time_left() -> float:
    """The processor time that the user's code may still take in this thread, in seconds."""
    clock = _own.clock
    return math.inf if clock is None else clock.limit - clock.spent().processor


def _clock_of(thread: int) -> Callable[[], float]:
    """The processor time of a thread; of the process, where a system has no other."""
    if hasattr(time, "pthread_getcpuclockid"):
        return functools.partial(time.clock_gettime, time.pthread_getcpuclockid(thread))
    return time.process_time


def _raise_in(thread: int, error: type[BaseException] | None) -> None:
    """Raise in another thread at its next line of Python; None takes back what has not been."""
    ctypes.pythonapi.PyThreadState_SetAsyncExc(
        ctypes.c_ulong(thread), None if error is None else ctypes.py_object(error)
    )
