"""Signs of life from work that compiles for long, which may be left off between two programs."""

from __future__ import annotations

import contextlib
import inspect
from collections.abc import Iterator
from typing import Any

import jax

from ropeode.progress import Progress


@contextlib.contextmanager
def told_of(progress: Progress) -> Iterator[Progress]:
    """Progress that is also told whenever JAX has traced, lowered or compiled something.

    Arguments:
        progress: called with what it was told last; in any thread, and what it raises ends the
            work there, unless a module is being imported, which would be left half done.
    """
    last: tuple[str, float | None] = "", None

    def told(text: str, fraction: float | None) -> None:
        nonlocal last
        last = text, fraction
        progress(*last)

    def again(*_: Any, **__: Any) -> None:
        if not _imports():
            progress(*last)

    jax.monitoring.register_event_duration_secs_listener(again)
    try:
        yield told
    finally:
        jax.monitoring.unregister_event_duration_listener(again)


def _imports() -> bool:
    frame = inspect.currentframe()
    while frame is not None and not frame.f_code.co_filename.startswith("<frozen importlib"):
        frame = frame.f_back
    return frame is not None
