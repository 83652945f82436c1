"""What a mutant is, and how one is made from the source text of a right stepper."""

from __future__ import annotations

import dataclasses
import inspect
import textwrap
from collections.abc import Callable, Mapping
from typing import Any

from tests.checking.mutants import originals
from tests.checking.mutants.originals import ORIGINALS


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


def source_of(original: Callable) -> str:
    """Its source text, with that of the forces it computes itself."""
    parts = [original]
    if original.__name__.startswith("own_"):
        parts.insert(0, originals.own_forces)
    return "\n\n".join(textwrap.dedent(inspect.getsource(part)) for part in parts)


def from_source(original: Callable, name: str, change: str, source: str) -> Mutant:
    """The mutant of an original that has another source text."""
    family, claims = ORIGINALS[original]

    def make() -> Any:
        # What else the text names is what it names in the module of the originals.
        namespace = dict(vars(originals))
        exec(compile(source, f"<{name}>", "exec"), namespace)
        return namespace[original.__name__]

    return Mutant(name, family, claims, change, make)


# "old -> new", or several of them.
Changes = str | tuple[str, ...]


def by_hand(table: Mapping[Callable, Mapping[str, Changes]]) -> tuple[Mutant, ...]:
    """Mutants made by hand.

    Arguments:
        table: of each of `ORIGINALS` the mistakes, in a few words, and what they change in its
            source; each old text stands there once.
    """
    return tuple(
        _replaced(original, what, (changes,) if isinstance(changes, str) else changes)
        for original, mistakes in table.items()
        for what, changes in mistakes.items()
    )


def _replaced(original: Callable, what: str, changes: tuple[str, ...]) -> Mutant:
    source = source_of(original)
    for change in changes:
        old, new = change.split(" -> ")
        assert source.count(old) == 1, f"{old!r} stands {source.count(old)} times"
        source = source.replace(old, new)
    return from_source(original, f"{original.__name__}: {what}", what, source)


def before(text: str, *lines: str) -> str:
    """The change that puts lines before a text, indented as it is."""
    indent = text[: len(text) - len(text.lstrip())]
    return f"{text} -> " + "".join(f"{indent}{line}\n" for line in lines) + text


def at_end(*lines: str) -> str:
    """The change that puts lines before a function returns."""
    return before("    return x_new, v_new", *lines)


def by_closure(original: Callable, made: Mapping[str, Callable[[], Any]]) -> tuple[Mutant, ...]:
    """Mutants that are functions which keep something from call to call, made anew for each use."""
    family, claims = ORIGINALS[original]
    return tuple(
        Mutant(f"{original.__name__}: {what}", family, claims, what, make)
        for what, make in made.items()
    )
