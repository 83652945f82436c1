"""Bars where somebody looks on: in notebooks and terminals."""

from __future__ import annotations

import inspect
import io
import sys
import threading
from types import SimpleNamespace

import pytest

import ropeode
from ropeode import bars, simulate
from ropeode.errors import InputError
from ropeode.progress import bar, shows_progress, silent
from tests.time_limit import until

LONG_S = 5.0
LOOK_S = 0.01


class Notebook:
    """What a notebook was sent: for each output of a cell, its contents one after the other."""

    def __init__(self) -> None:
        self.outputs: list[list[dict[str, str]]] = []

    def display(self, bundle, *, raw, display_id):
        self.outputs.append(output := [bundle])
        return SimpleNamespace(update=lambda bundle, raw: output.append(bundle))

    def count(self) -> int:
        return sum(map(len, self.outputs))

    def wait(self) -> None:
        """Until it is sent what the work says now; one thing may be on its way already."""
        enough = self.count() + 2
        until(lambda: self.count() >= enough)
        assert "starting" not in self.outputs[-1][-1]["text/plain"]


EMPTY = {"text/plain": "", "text/html": ""}


@pytest.fixture
def notebook(monkeypatch):
    """Stands for Jupyter; there, work of no time shows a bar."""
    made = Notebook()
    shell = SimpleNamespace(kernel="a kernel")
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: shell))
    monkeypatch.setitem(sys.modules, "IPython.display", SimpleNamespace(display=made.display))
    monkeypatch.setattr(bars, "AFTER_S", 0.0)
    monkeypatch.setattr(bars, "EVERY_S", LOOK_S)
    return made


@shows_progress
def work(until=lambda: None, progress=bar):
    progress("a < b", 0.25)
    until()
    return "done"


@shows_progress
def pieces(until, progress=bar):
    for piece in range(3):
        progress(f"piece {piece}", piece / 3)
        until()
        yield piece


def test_a_notebook_shows_a_bar_which_goes_away(notebook, monkeypatch):
    assert work(notebook.wait) == "done"
    (output,) = notebook.outputs
    *_, shown, last = output
    assert shown["text/plain"].startswith("25 % a < b, ")
    page = '<progress max="1" value="0.250"></progress> 25 % a &lt; b'
    assert shown["text/html"].startswith(page)
    assert last == EMPTY
    # What is done soon shows nothing.
    monkeypatch.setattr(bars, "AFTER_S", LONG_S)
    assert work() == "done"
    assert len(notebook.outputs) == 1


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_what_is_raised_ends_the_bar(notebook, error):
    def fail():
        notebook.wait()
        raise error

    threads = threading.active_count()
    for _ in range(2):
        with pytest.raises(error):
            work(fail)
    assert [output[-1] for output in notebook.outputs] == [EMPTY, EMPTY]
    assert threading.active_count() == threads


def test_what_runs_inside_shows_no_second_bar(notebook):
    def inside():
        notebook.wait()
        thread = threading.Thread(target=work)
        thread.start()
        thread.join()
        work(lambda: notebook.wait())

    work(inside)
    assert len(notebook.outputs) == 1
    # Nor does it where the caller of the whole wants none.
    said = []
    work(work, progress=silent)
    work(work, progress=lambda *each: said.append(each))
    assert len(notebook.outputs) == 1
    assert said == [("a < b", 0.25)]


def test_an_iterator_has_one_bar_for_all_that_it_yields(notebook):
    assert list(pieces(notebook.wait)) == [0, 1, 2]
    output = notebook.outputs[-1]
    assert {"0 % piece 0", "67 % piece 2"} <= {each["text/plain"].split(",")[0] for each in output}
    assert output[-1] == EMPTY
    # One that is left, too; between two pieces other work has its bar.
    left = pieces(notebook.wait)
    next(left)
    work(notebook.wait)
    del left
    assert all(output[-1] == EMPTY for output in notebook.outputs)
    assert len(notebook.outputs) >= 3


def test_a_terminal_shows_a_bar(monkeypatch):
    class Terminal(io.StringIO):
        def isatty(self):
            return True

    monkeypatch.setattr(sys, "stderr", screen := Terminal())
    monkeypatch.setattr(bars, "AFTER_S", 0.0)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(bars, "EVERY_S", LOOK_S)

    def drawn(words):
        until(lambda: words in screen.getvalue())

    work(lambda: drawn("a < b"))
    assert "25%" in screen.getvalue()
    # It erases its line, and shows the cursor again.
    assert screen.getvalue().endswith("\x1b[2K")
    assert "\x1b[?25h" in screen.getvalue()
    # Also before it hands out a piece, with which its caller may print.
    left = pieces(lambda: drawn("piece 0"))
    next(left)
    assert screen.getvalue().endswith("\x1b[2K")


def test_every_public_function_that_takes_progress_shows_a_bar():
    takes = set()
    for name in ropeode.__all__:
        public = getattr(ropeode, name)
        for each in [public, *(vars(public).values() if inspect.isclass(public) else ())]:
            parameters = inspect.signature(each).parameters if inspect.isfunction(each) else {}
            if (parameter := parameters.get("progress")) is not None:
                assert parameter.kind is parameter.KEYWORD_ONLY, each
                assert parameter.default is bar, each
                assert each.__code__ is work.__code__, each
                takes.add(each.__name__)
    assert {"reference", "simulate", "save"} <= takes


def test_progress_that_cannot_be_called_is_refused(small_rope):
    with pytest.raises(InputError, match=r"progress: None given; .*ropeode\.progress\.silent"):
        simulate(small_rope, "rk4", 16, progress=None)  # type: ignore[arg-type]
