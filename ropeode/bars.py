"""Progress bars, in terminals and notebooks."""

from __future__ import annotations

import contextvars
import html
import multiprocessing
import sys
import threading
import time
from collections.abc import Callable
from typing import Any, Protocol, TextIO

from ropeode import sandbox

# Work that is done sooner shows no bar.
AFTER_S = 2.0
# A notebook keeps the messages that it is sent.
EVERY_S = 0.5


class Bar(Protocol):
    """Something that is drawn again and again, and goes away without a trace."""

    def draw(self, text: str, fraction: float | None) -> None:
        """Show what is being done, and the fraction that is done: None where nobody knows."""
        ...

    def pause(self) -> None:
        """The work has handed something to its caller, who may print."""
        ...

    def erase(self) -> None:
        """Leave nothing."""
        ...


class TerminalBar:
    """A bar on standard error.

    Arguments:
        time_left: show the estimated time that is left in place of the time that has passed.
    """

    def __init__(self, *, time_left: bool = False):
        from rich import progress
        from rich.console import Console

        self._bar = progress.Progress(
            progress.BarColumn(bar_width=20),
            progress.TaskProgressColumn(),
            progress.TimeRemainingColumn() if time_left else progress.TimeElapsedColumn(),
            progress.TextColumn("{task.description}"),
            console=Console(stderr=True),
            transient=True,
            # What code prints into a file while a bar is shown belongs into that file.
            redirect_stdout=_is_terminal(sys.stdout),
        )
        self._task = self._bar.add_task("", total=None)

    def draw(self, text: str, fraction: float | None) -> None:
        """As for `Bar`; it also draws itself until it is erased, for the time."""
        # Rich leaves the bar where it is if the fraction is None.
        self._bar.update(self._task, description=text, completed=fraction, total=1.0)
        self._bar.start()

    def erase(self) -> None:
        """As for `Bar`."""
        self._bar.stop()

    pause = erase


class NotebookBar:
    """An output of a cell, which stays empty in the end."""

    def __init__(self) -> None:
        self._began = time.monotonic()
        self._output: Any = None

    def draw(self, text: str, fraction: float | None) -> None:
        """As for `Bar`."""
        text = f"{text}, {AFTER_S + time.monotonic() - self._began:.0f} s"
        value = ""
        if fraction is not None:
            value, text = f' value="{fraction:.3f}"', f"{100 * fraction:.0f} % {text}"
        self._show(text, f'<progress max="1"{value}></progress> {html.escape(text)}')

    def pause(self) -> None:
        """It is beside what the caller prints."""

    def erase(self) -> None:
        """As for `Bar`."""
        self._show("", "")

    def _show(self, text: str, page: str) -> None:
        bundle = {"text/plain": text, "text/html": page}
        if self._output is not None:
            self._output.update(bundle, raw=True)
            return
        from IPython.display import display

        self._output = display(bundle, raw=True, display_id=True)


class TimedBar:
    """Shows a bar once work has lasted two seconds, from a thread of its own.

    As a context manager it surrounds the work, or each piece of it.

    Arguments:
        make: the bar, when it is first drawn.
    """

    def __init__(self, make: Callable[[], Bar]):
        self._make = make
        self._bar: Bar | None = None
        self._said: tuple[str, float | None] = ("starting", None)
        self._due: float | None = None
        self._stopped = threading.Event()
        self._thread: threading.Thread | None = None

    def report(self, text: str, fraction: float | None) -> None:
        """Progress of the work; where nobody knows its fraction, the last one holds."""
        self._said = text, self._said[1] if fraction is None else fraction

    def __enter__(self) -> None:
        if self._due is None:
            self._due = time.monotonic() + AFTER_S
        self._stopped.clear()
        # Jupyter knows by the context which cell an output belongs to.
        run = contextvars.copy_context().run
        self._thread = threading.Thread(target=run, args=(self._draw,), daemon=True)
        self._thread.start()

    def __exit__(self, *_: object) -> None:
        self._stopped.set()
        if self._thread is not None:
            self._thread.join()
        if self._bar is not None:
            self._bar.pause()

    def erase(self) -> None:
        """Leave nothing; more work would begin anew."""
        if self._bar is not None:
            self._bar.erase()
        self._bar = self._due = None

    def _draw(self) -> None:
        assert self._due is not None
        while not self._stopped.wait(max(0.0, self._due - time.monotonic())):
            if self._bar is None:
                self._bar = self._make()
            self._bar.draw(*self._said)
            self._due = time.monotonic() + EVERY_S


def bar_here() -> TimedBar | None:
    """A bar where somebody looks on: in a notebook or a terminal. None in workers and files."""
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython else None
    if sandbox.is_child() or multiprocessing.parent_process() is not None:
        return None
    if getattr(shell, "kernel", None) is not None:
        return TimedBar(NotebookBar)
    return TimedBar(TerminalBar) if _is_terminal(sys.stderr) else None


def _is_terminal(stream: TextIO | None) -> bool:
    return stream is not None and stream.isatty()
