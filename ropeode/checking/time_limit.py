"""Runs a user's code under a time limit, and captures what it prints."""

from __future__ import annotations

import contextlib
import io
import threading
import time
from collections.abc import Callable, Iterator
from typing import TypeVar

from ropeode.errors import UserCodeError
from ropeode.simulation import UserClock, take_turn_from

T = TypeVar("T")

# The wall time that is allowed, over the processor time: so long a step may wait for something.
# Where the system does not count how long it waits for a processor, that is in it.
_WAITING = 10.0
# How often the clock is read, and how long a step that was interrupted is waited for.
_LOOKS_AGAIN_S, _ENDS_IN_S = 0.02, 1.0


class OutOfTime(UserCodeError):
    """Something with the user's code did not return in time.

    Arguments:
        what: did not.
        why: which time is meant.
    """

    def __init__(self, what: str, why: str):
        self.why = why
        super().__init__(
            f"step: {what} did not finish {why}; allowed: a step that returns. "
            "Fix: look for a loop that does not end, or raise the time limit (--time-limit)."
        )


def within(
    seconds: float,
    what: str,
    work: Callable[[], T],
    overall: float | None = None,
    meanwhile: Callable[[], None] = lambda: None,
) -> T:
    """Call a function in a thread of its own, and abandon it at the time limit.

    What counts is the processor time of the user's steps that it runs, and ten times as much of
    their wall time. What ropeode does besides, such as compiling, does not count.

    A step in Python is interrupted. One in compiled code cannot be: its thread goes on, but
    neither keeps other runs nor the end of the process waiting.

    Arguments:
        seconds: the time limit.
        what: is done, for the message.
        work: the function; its exceptions are raised here.
        overall: the wall time that all of it may take, in seconds, without waiting for a
            processor; None for as long as it needs.
        meanwhile: called first, and again and again while the function runs; what it raises ends
            the work.

    Raises:
        OutOfTime: it did not return in time.
    """
    results: list[T] = []
    raised: list[BaseException] = []
    clocks: list[UserClock] = []
    ready = threading.Event()

    def run() -> None:
        clocks.append(UserClock(seconds))
        ready.set()
        try:
            results.append(work())
        except BaseException as error:
            raised.append(error)

    meanwhile()
    worker = threading.Thread(target=run, daemon=True)
    worker.start()
    ready.wait()
    while worker.is_alive():
        worker.join(_LOOKS_AGAIN_S)
        try:
            meanwhile()
        except BaseException:
            _end(worker, clocks[0])
            raise
        processor, wall = clocks[0].spent()
        if processor > seconds:
            why = f"within {seconds:g} s of processor time in the step"
        elif wall > _WAITING * seconds:
            why = (
                f"within {_WAITING * seconds:g} s: the step used {processor:.2g} s of processor "
                f"time, fewer than the {seconds:g} s that it may, and waited for the rest"
            )
        elif overall is not None and clocks[0].age() > overall:
            why = (
                f"within {overall:g} s, of which {processor:.2g} s were processor time in the step"
            )
        else:
            continue
        _end(worker, clocks[0])
        raise OutOfTime(what, why)
    if raised:
        raise raised[0]
    return results[0]


def _end(worker: threading.Thread, clock: UserClock) -> None:
    """Interrupt the user's code, or let others run if it cannot be."""
    waits_until = time.monotonic() + _ENDS_IN_S
    # Again and again: it may catch everything.
    while worker.is_alive() and time.monotonic() < waits_until:
        clock.interrupt()
        worker.join(_LOOKS_AGAIN_S)
    if worker.is_alive():
        take_turn_from(worker.ident or 0)


class Printed(io.StringIO):
    """Printed text, of which the beginning is kept, even if the user's code closes it."""

    def __init__(self) -> None:
        super().__init__()
        self.beginning = ""

    def write(self, text: str) -> int:
        """Keep a thousand characters and discard the rest."""
        # As of any file: nothing is written to a closed one.
        super().write("")
        self.beginning += text[: 1000 - len(self.beginning)]
        return len(text)


@contextlib.contextmanager
def kept_output() -> Iterator[Printed]:
    """Capture standard output."""
    printed = Printed()
    with contextlib.redirect_stdout(printed):
        yield printed
