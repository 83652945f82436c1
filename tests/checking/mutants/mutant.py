"""What a mutant is, and how one is made from the source text of a right stepper."""

from __future__ import annotations

import dataclasses
import functools
import inspect
import textwrap
import tomllib
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from tests.checking.mutants import originals
from tests.checking.mutants.originals import ORIGINALS

BY_HAND = tomllib.loads((Path(__file__).parent / "by_hand.toml").read_text())


@dataclasses.dataclass(frozen=True)
class Mutant:
    """A wrong stepper.

    Arguments:
        name: unique; begins with what it was made from.
        family: as in the tables.
        claims: what its author says of it, as `check_stepper` takes it.
        change: what is wrong with it.
        make: makes the stepper, anew for each use.
    """

    name: str
    family: str
    claims: Mapping[str, Any]
    change: str
    make: Callable[[], Any]


@functools.cache
def source_of(original: Callable) -> str:
    """Its source text, with that of the forces it computes itself."""
    parts = [original]
    if original.__name__.startswith("own_"):
        parts.insert(0, originals.own_forces)
    return "\n\n".join(textwrap.dedent(inspect.getsource(part)) for part in parts)


def from_source(original: Callable, name: str, change: str, source: str) -> Mutant:
    """The mutant of an original that has another source text."""

    def make() -> Any:
        # What else the text names is what it names in the module of the originals.
        namespace = dict(vars(originals))
        exec(compile(source, f"<{name}>", "exec"), namespace)
        return namespace[original.__name__]

    return Mutant(name, *ORIGINALS[original], change, make)


def by_hand(kind: str) -> tuple[Mutant, ...]:
    """The mutants of a kind in `by_hand.toml`, which says how they are written."""
    return tuple(
        _changed(getattr(originals, original), what, changes)
        for original, mistakes in BY_HAND[kind].items()
        for name, written in mistakes.items()
        for what, changes in _for_each_number(name, written)
    )


def _for_each_number(name: str, written: Any) -> Iterator[tuple[str, list[str]]]:
    family = written if isinstance(written, dict) else {"n": [0], "change": written}
    changes = family["change"] if isinstance(family["change"], list) else [family["change"]]
    for n in family["n"]:
        yield name.format(n=n), [each.format(n=n, **BY_HAND["words"]) for each in changes]


def _changed(original: Callable, what: str, changes: list[str]) -> Mutant:
    source = source_of(original)
    for change in changes:
        if " -> " in change:
            old, new = change.split(" -> ")
        else:
            place, line = change.split(": ", 1)
            old = BY_HAND["places"][place]
            indent = old[: len(old) - len(old.lstrip())]
            new = f"{indent}{line}\n{old}"
        assert source.count(old) == 1, f"{old!r} stands {source.count(old)} times"
        source = source.replace(old, new)
    return from_source(original, f"{original.__name__}: {what}", what, source)
