"""How long work reports its progress."""

from __future__ import annotations

import contextlib
import functools
import threading
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

if TYPE_CHECKING:
    from ropeode.bars import TimedBar

P = ParamSpec("P")
T = TypeVar("T")

# Called with what is being done, and the fraction that is done: None where nobody knows.
Progress = Callable[[str, float | None], None]

# Held while a public function works, so that those which it calls show no bar beside its own. They
# may run in other threads.
_at_work = threading.Lock()
_END = object()


class _Silent:
    """Report nothing. `help` shows its name, where a function would show an address."""

    def __call__(self, text: str, fraction: float | None) -> None:
        del text, fraction

    def __repr__(self) -> str:
        return "silent"


silent = _Silent()


def bar(text: str, fraction: float | None) -> None:
    """Stands for a bar where somebody looks on, which `shows_progress` puts in its place."""
    del text, fraction


def part_of(progress: Progress, start: float, end: float) -> Progress:
    """Progress of a part of the work, which takes it from one fraction of the whole to another."""

    def report(text: str, fraction: float | None) -> None:
        progress(text, None if fraction is None else start + (end - start) * fraction)

    return report


@contextlib.contextmanager
def outermost() -> Iterator[bool]:
    """Whether no function that shows progress is at work yet."""
    first = _at_work.acquire(blocking=False)
    try:
        yield first
    finally:
        if first:
            _at_work.release()


def shows_progress(work: Callable[P, T]) -> Callable[P, T]:
    """A function that shows a bar in notebooks and terminals, unless it is given other progress.

    Of an iterator that it returns, too, what is computed from one value to the next counts.

    Arguments:
        work: has the keyword `progress`, by default `bar`.
    """

    @functools.wraps(work)
    def working(*given: Any, **named: Any) -> Any:
        progress = named.get("progress", bar)
        if not callable(progress):
            # Not above: importing ropeode is quick.
            from ropeode.validation import bad_value

            allowed = "a function that is called with a text and a fraction"
            fix = "use ropeode.progress.silent to show nothing"
            raise bad_value("progress", progress, allowed, fix)
        with outermost() as first:
            shown = _bar_here() if first and progress is bar else None
            if shown is None:
                return work(*given, **named)
            try:
                with shown:
                    result: Any = work(*given, **{**named, "progress": shown.report})
            finally:
                shown.erase()
        return _in_pieces(result, shown) if isinstance(result, Iterator) else result

    return working


def _bar_here() -> TimedBar | None:
    from ropeode.bars import bar_here

    return bar_here()


def _in_pieces(values: Iterator[T], shown: TimedBar) -> Iterator[T]:
    """The same values, with a bar while the next one is computed."""
    try:
        while True:
            with outermost() as first, shown if first else contextlib.nullcontext():
                value: Any = next(values, _END)
            if value is _END:
                return
            yield value
    finally:
        shown.erase()
