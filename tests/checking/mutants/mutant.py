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


def replaced(original: Callable, what: str, *changes: tuple[str, str]) -> Mutant:
    """A mutant made by hand.

    Arguments:
        original: one of `ORIGINALS`.
        what: the mistake, in a few words.
        changes: old and new text; the old one stands once in the source.
    """
    source = source_of(original)
    for old, new in changes:
        assert source.count(old) == 1, f"{old!r} stands {source.count(old)} times"
        source = source.replace(old, new)
    return from_source(original, f"{original.__name__}: {what}", what, source)
