"""What Python functions raise while a compiled program calls them.

XLA cannot carry an exception: it would print a page of its own text, and end the process in an
error at exit. So such a function keeps its exception here and returns not-a-number, and whoever
runs the program raises the exception again.
"""

from __future__ import annotations

import collections
import contextlib
import dataclasses
import itertools
import threading
from collections.abc import Iterator


@dataclasses.dataclass
class _Kept:
    """The first exception of a function in some run, and the number of the last one."""

    function: object
    error: BaseException
    last: int
    raised: bool = False


_numbers = itertools.count(1)
# Programs call from threads of their own, and nobody knows for whom. So each is raised by all
# blocks that run when it comes, whatever their thread: none returns a result that is not one.
_kept: collections.deque[_Kept] = collections.deque(maxlen=8)
_seen = threading.local()


def keep(function: object, error: BaseException) -> None:
    """Have an exception of a function raised where its program is run."""
    latest = _kept[-1] if _kept else None
    # What was handed not-a-number raises again; the first exception says more.
    if latest and latest.function is function and not latest.raised:
        latest.last = next(_numbers)
    else:
        _kept.append(_Kept(function, error, next(_numbers)))


@contextlib.contextmanager
def raised_again() -> Iterator[None]:
    """Raise what is kept while the block runs, in place of whatever the block raises itself."""
    before = _last()
    try:
        yield
    finally:
        # A block within this one may have raised it, and someone may have caught it.
        before = max(before, getattr(_seen, "last", 0))
        if _last() > before:
            first = next(each for each in _kept if each.last > before)
            first.raised, _seen.last = True, _last()
            raise first.error


def _last() -> int:
    return _kept[-1].last if _kept else 0
