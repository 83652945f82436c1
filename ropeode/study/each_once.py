"""Lists of what is named, with all that is wrong with them."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, Protocol, TypeVar

from ropeode.errors import InputError
from ropeode.validation import bad_value, check_all, complaint


class Labelled(Protocol):
    """What has a label, as in tables."""

    @property
    def label(self) -> str:
        """By which it is told from others."""
        ...


L = TypeVar("L", bound=Labelled)


def each_once(
    kind: str,
    given: Any,
    make: Callable[[Any], L],
    examples: str,
    fault: Callable[[L, L | None], str | None],
) -> list[L]:
    """What is made of each entry of a list; a single one may stand alone.

    Arguments:
        kind: of the entries, in the singular.
        given: the list.
        make: from an entry.
        examples: of entries, for an empty list.
        fault: what is wrong with one of them, given the earlier one with its label, if any.

    Raises:
        InputError: one line for each that cannot be made or is at fault.
        UserCodeError: the user's file or class raised.
    """
    entries = given if isinstance(given, (list, tuple)) else [given]
    if not entries:
        raise bad_value(f"{kind}s", [], f"at least one {kind}", f"name one, such as {examples}")
    chosen: dict[str, L] = {}

    def take(entry: Any) -> None:
        made = make(entry)
        earlier, chosen[made.label] = chosen.get(made.label), made
        if wrong := fault(made, earlier):
            raise InputError(wrong)

    check_all(*(functools.partial(take, each) for each in entries))
    return list(chosen.values())


def repeated(kind: str, label: str, fix: str = "drop one") -> str:
    """The complaint about an entry that a list has already."""
    return complaint(f"{kind}s", label, f"each {kind} once", fix)
