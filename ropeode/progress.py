"""How long work reports its progress."""

from __future__ import annotations

from collections.abc import Callable

# Called with what is being done, and the fraction that is done: None where nobody knows.
Progress = Callable[[str, float | None], None]


def silent(text: str, fraction: float | None) -> None:
    """Report nothing."""
    del text, fraction


def part_of(progress: Progress, start: float, end: float) -> Progress:
    """Progress of a part of the work, which takes it from one fraction of the whole to another."""

    def report(text: str, fraction: float | None) -> None:
        progress(text, None if fraction is None else start + (end - start) * fraction)

    return report
