"""Long commands: they set up JAX, show a progress bar, and end on Ctrl-C."""

from __future__ import annotations

import contextlib
import datetime
import gc
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any, TypeVar

import click

from ropeode.progress import Progress

T = TypeVar("T")

_LOOK_EVERY_S = 0.1
_LINE_EVERY_S = 30.0
INTERRUPTED = 130
# What Ctrl-C leaves.
NOTHING = "nothing was written"
KEPT = "finished cases are kept; run the same command to resume"
_CLEAR_LINE_SHOW_CURSOR = "\r\x1b[2K\x1b[?25h"


def end_on_ctrl_c(left: str = NOTHING, *, before: Callable[[], None] = lambda: None) -> None:
    """Let Ctrl-C end the process at once, with a message.

    An exception would not do: extension modules swallow it while they are imported.

    Arguments:
        left: what happens to the work, for the message.
        before: called before the process ends.
    """

    def end(*_: Any) -> None:
        before()
        clear = _CLEAR_LINE_SHOW_CURSOR if sys.stderr.isatty() else ""
        os.write(2, f"{clear}ropeode: interrupted; {left}.\n".encode())
        os._exit(INTERRUPTED)

    signal.signal(signal.SIGINT, end)


@contextlib.contextmanager
def not_interrupted() -> Iterator[None]:
    """Ignore Ctrl-C while a result is written."""
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def set_up_jax() -> None:
    """Switch on 64-bit types, and cache traced and compiled programs in the user's cache folder."""
    # What is imported stays: to look for garbage in it takes a tenth of the time.
    gc.disable()
    from ropeode.references.jax_setup import set_up_jax as set_up

    set_up()
    gc.freeze()
    gc.enable()


@contextlib.contextmanager
def show_progress(*, time_left: bool = False) -> Iterator[Progress]:
    """A bar on standard error, which disappears at the end; a line now and then in a file.

    Arguments:
        time_left: show the estimated time that is left in place of the time that has passed.
    """
    if not sys.stderr.isatty():
        yield _in_lines()
        return
    from ropeode.bars import TerminalBar

    bar = TerminalBar(time_left=time_left)
    try:
        bar.draw("starting", None)
        yield bar.draw
    finally:
        bar.erase()


def _in_lines() -> Progress:
    """Progress in a file: a line now and then, and none for what is done soon."""
    began = told = time.monotonic()
    start: float | None = None

    def update(text: str, fraction: float | None) -> None:
        nonlocal told, start
        now = time.monotonic()
        if fraction is not None and start is None:
            start = fraction
        if now - told < _LINE_EVERY_S:
            return
        told = now
        if fraction is not None and start is not None and fraction > start:
            left = (now - began) * (1.0 - fraction) / (fraction - start)
            text += f", {datetime.timedelta(seconds=round(left))} left"
        click.echo(f"ropeode: {text}", err=True)

    return update


def with_progress(work: Callable[[Progress], T], *, time_left: bool = False) -> T:
    """Do work that reports its progress, in a way that Ctrl-C ends at once.

    Arguments:
        work: called with what shows progress.
        time_left: as for `show_progress`.
    """
    with show_progress(time_left=time_left) as progress:
        return interruptible(lambda: work(progress))


def interruptible(work: Callable[[], T]) -> T:
    """Do the work in a way that Ctrl-C ends at once.

    Python handles a signal only between its own instructions, and one call into compiled code
    may last minutes. So the work runs in a thread that the process does not wait for.
    """
    result: dict[str, Any] = {}

    def run() -> None:
        try:
            result["value"] = work()
        except BaseException as error:
            result["error"] = error

    worker = threading.Thread(target=run, daemon=True)
    worker.start()
    while worker.is_alive():
        worker.join(_LOOK_EVERY_S)
    if "error" in result:
        raise result["error"]
    return result["value"]
