"""A user's code, run so that it cannot hang the caller, and so that what it prints is kept."""

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
    """Do the work in a thread of its own, and give up on it when its time is over.

    A loop in Python is ended. What hangs inside compiled code cannot be: its thread is left
    to itself, and does not keep the process from ending.

    Arguments:
        seconds: that it has.
        work: to be done; what it raises is raised.

    Raises:
        UserCodeError: it did not return in time.
    """
    found: list[T] = []
    raised: list[BaseException] = []

    def run() -> None:
        try:
            found.append(work())
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
            f"step: it did not return within {seconds:g} s; allowed: a step that ends. Fix: see "
            "whether a loop in it ends, or allow more time with the time limit."
        )
    if raised:
        raise raised[0]
    return found[0]


class Printed(io.StringIO):
    """What was printed, up to a thousand characters."""

    def write(self, text: str) -> int:
        """Keep the beginning, and drop the rest."""
        if self.tell() < 1000:
            super().write(text)
        return len(text)


@contextlib.contextmanager
def kept_output() -> Iterator[Printed]:
    """Standard output, kept away from the terminal."""
    printed = Printed()
    with contextlib.redirect_stdout(printed):
        yield printed
