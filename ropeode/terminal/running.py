"""Long commands: they set up JAX, show a progress bar, and end on Ctrl-C."""

from __future__ import annotations

import contextlib
import datetime
import faulthandler
import gc
import os
import signal
import sys
import sysconfig
import threading
import time
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeVar

import click

from ropeode.errors import streams_kept
from ropeode.progress import Progress, outermost
from ropeode.sandbox import doing as tell_parent

T = TypeVar("T")

_LOOK_EVERY_S = 0.1
_LINE_EVERY_S = 30.0
INTERRUPTED = 130
# What Ctrl-C leaves.
NOTHING = "nothing was written"
KEPT = "finished cases are kept; run the same command to resume"
# How often threads are looked at while a compiled program may compute nothing.
_LOOKS_AT_THREADS = 12
# Clock ticks in a second, a hundredth of its time, of a process that waits.
_IDLE = 1.0
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
    from ropeode import cache

    cache.set_up_jax()
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
        # What is called inside shows no bar beside this one.
        with outermost():
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


def with_progress(
    work: Callable[[Progress], T], *, time_left: bool = False, gives_up_after: float = 120.0
) -> T:
    """Do work that reports its progress, in a way that Ctrl-C ends at once.

    Arguments:
        work: called with what shows progress.
        time_left: as for `show_progress`.
        gives_up_after: seconds; a compiled program that has computed nothing for so long does not
            return.

    Raises:
        RuntimeError: a compiled program does not return.
    """
    with show_progress(time_left=time_left) as progress:
        doing = "the start"

        def seen(text: str, fraction: float | None) -> None:
            nonlocal doing
            doing = text
            tell_parent(text)
            progress(text, fraction)

        with streams_kept():
            return _interruptible(lambda: work(seen), lambda: doing, gives_up_after)


def _interruptible(work: Callable[[], T], doing: Callable[[], str], gives_up_after: float) -> T:
    """Do the work in a way that Ctrl-C ends at once.

    Python handles a signal only between its own instructions, and one call into compiled code
    may last minutes. So the work runs in a thread that the process does not wait for.

    Arguments:
        work: to do.
        doing: says what it does.
        gives_up_after: as for `with_progress`.

    Raises:
        RuntimeError: a compiled program does not return.
    """
    result: dict[str, Any] = {}

    def run() -> None:
        try:
            result["value"] = work()
        except BaseException as error:
            result["error"] = error

    worker = threading.Thread(target=run, daemon=True)
    worker.start()
    waits = _Waits(gives_up_after)
    while worker.is_alive():
        worker.join(_LOOK_EVERY_S)
        if waits.for_ever():
            if "--debug" in sys.argv:
                faulthandler.dump_traceback()
            raise RuntimeError(
                f"a compiled program has waited for {gives_up_after:g} s and computed nothing; "
                f"the last that was said of the work: {doing()}"
            )
    if "error" in result:
        raise result["error"]
    return result["value"]


class _Waits:
    """Whether a compiled program waits for what never comes.

    Arguments:
        seconds: for which it has computed nothing then.
    """

    def __init__(self, seconds: float) -> None:
        self._every = seconds / _LOOKS_AT_THREADS
        self._looked_at = time.monotonic()
        self._used: dict[str, int] = {}
        self._times = 0

    def for_ever(self) -> bool:
        """To be asked again and again.

        Looks are counted: no time passes for a process that is stopped.
        """
        if time.monotonic() - self._looked_at < self._every:
            return False
        self._looked_at = time.monotonic()
        before, self._used = self._used, _processor_times()
        used = sum(now - before.get(each, 0) for each, now in self._used.items())
        # Without threads to be counted, nobody knows.
        waits = bool(self._used) and used <= _IDLE * self._every and _only_jax_is_at_work()
        self._times = self._times + 1 if waits else 0
        return self._times >= _LOOKS_AT_THREADS


def _processor_times() -> dict[str, int]:
    """Clock ticks of each thread, but the main one and that which draws a bar."""
    used = {}
    for stat in Path("/proc/self/task").glob("*/stat"):
        # Threads end meanwhile.
        with contextlib.suppress(OSError):
            fields = stat.read_text().rpartition(")")[2].split()
            used[stat.parent.name] = int(fields[11]) + int(fields[12])
    for each in threading.enumerate():
        if each is threading.main_thread() or type(each).__module__ == "rich.live":
            used.pop(str(each.native_id), None)
    return used


def _only_jax_is_at_work() -> bool:
    """Whether a thread has called JAX, and none the user's code, which may wait for anything."""
    tops = sys._current_frames().values()
    files = {each.f_code.co_filename for top in tops for each, _ in traceback.walk_stack(top)}
    return any("/jax/" in file for file in files) and not any(map(is_users_file, files))


def is_users_file(file: str) -> bool:
    """Whether a file of Python code is neither ropeode's nor installed."""
    installed = [str(Path(__file__).parents[1]), *sysconfig.get_paths().values()]
    return not file.startswith(("<", *installed))
