"""How long work reports its progress."""

from __future__ import annotations

from collections.abc import Callable

# Called with what is being done, and the fraction that is done: None where nobody knows.
Progress = Callable[[str, float | None], None]


def silent(text: str, fraction: float | None) -> None:
    """Report nothing."""
    del text, fraction
