"""Runs a user's code under a time limit, and captures what it prints."""

from __future__ import annotations

import contextlib
import ctypes
import io
import threading
from collections.abc import Callable, Iterator
from typing import TypeVar

from ropeode.errors import UserCodeError

T = TypeVar("T")


class TimeIsUp(BaseException):
    """Raised inside the user's code; not an `Exception`, which it might catch."""


def within(seconds: float, work: Callable[[], T]) -> T:
    """Call a function in a thread of its own, and abandon it at the time limit.

    A loop in Python is interrupted. Compiled code cannot be: its thread goes on, but does not
    keep the process from ending.

    Arguments:
        seconds: the time limit.
        work: the function; its exceptions are raised here.

    Raises:
        UserCodeError: it did not return in time.
    """
    results: list[T] = []
    raised: list[BaseException] = []

    def run() -> None:
        try:
            results.append(work())
        except BaseException as error:
            raised.append(error)

    worker = threading.Thread(target=run, daemon=True)
    worker.start()
    worker.join(seconds)
    if worker.is_alive():
        ctypes.pythonapi.PyThreadState_SetAsyncExc(
            ctypes.c_ulong(worker.ident or 0), ctypes.py_object(TimeIsUp)
        )
        worker.join(1.0)
        raise UserCodeError(
            f"step: a check did not finish within {seconds:g} s; allowed: a step that returns. "
            "Fix: look for a loop that does not end, or raise the time limit (--time-limit)."
        )
    if raised:
        raise raised[0]
    return results[0]


class Printed(io.StringIO):
    """Printed text, up to a thousand characters."""

    def write(self, text: str) -> int:
        """Keep the beginning and discard the rest."""
        if self.tell() < 1000:
            super().write(text)
        return len(text)


@contextlib.contextmanager
def kept_output() -> Iterator[Printed]:
    """Capture standard output."""
    printed = Printed()
    with contextlib.redirect_stdout(printed):
        yield printed
