"""What a page says that it wants, read entry by entry."""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import Any

from pydantic import ValidationError

from ropeode.errors import InputError
from ropeode.laboratory.messages import LONGEST_KEY, MOST_WANTED, Ask, Refused, Wanted
from ropeode.validation import complaint

# Of one message: files of trajectories that were dropped on the page are the longest.
MOST_TEXT = 2**24
_FORM = '{"want": [{"key": ..., "ask": {...}}, ...]}'


def wants_of(entries: Iterable[Any]) -> tuple[dict[str, Ask], list[tuple[str, Refused]]]:
    """Questions by key, the most urgent first; and what is refused, with its key."""
    wanted: dict[str, Ask] = {}
    refused: list[tuple[str, Refused]] = []
    for entry in entries:
        try:
            each = Wanted.model_validate(entry)
            wanted[each.key] = each.ask
        except (ValidationError, RecursionError) as error:
            refused.append((_key_of(entry), Refused(message=_sentence(error))))
    return wanted, refused


def entries_of(text: str | None) -> list[Any]:
    """What a message wants, entry by entry; nothing in them is checked yet.

    Raises:
        InputError: it is no such message.
    """
    if text is None:
        raise InputError(complaint("message", "bytes", f"text: {_FORM}", "send text"))
    if len(text) > MOST_TEXT:
        given, allowed = f"a message of {len(text)} characters", f"at most {MOST_TEXT}"
        raise InputError(complaint("message", given, allowed, "drop fewer or smaller files"))
    try:
        message = json.loads(text, parse_constant=_refuse_constant)
    except (ValueError, RecursionError) as error:
        why = "it is nested too deeply" if isinstance(error, RecursionError) else error
        allowed = f"JSON: {_FORM} ({why})"
        raise InputError(complaint("message", text[:100], allowed, "send JSON")) from None
    if not isinstance(message, dict) or not isinstance(message.get("want"), list):
        raise InputError(complaint("message", text[:100], _FORM, "send a list of questions"))
    if others := [name for name in message if name != "want"]:
        raise InputError(complaint("message", others[0][:100], _FORM, "leave it out"))
    entries = message["want"]
    if len(entries) > MOST_WANTED:
        given, allowed = f"{len(entries)} questions", f"at most {MOST_WANTED} at a time"
        raise InputError(complaint("want", given, allowed, "ask for the others later"))
    return entries


def _refuse_constant(name: str) -> None:
    raise ValueError(f"{name} is not a number in JSON")


def _key_of(entry: Any) -> str:
    """The key of an entry that cannot be used; empty if it has none."""
    key = entry.get("key") if isinstance(entry, dict) else None
    return key if isinstance(key, str) and len(key) <= LONGEST_KEY else ""


def _sentence(error: ValidationError | RecursionError) -> str:
    if isinstance(error, RecursionError):
        return complaint("want", "a question", "one that is not nested so deeply", "ask another")
    fault = error.errors(include_url=False, include_context=False)[0]
    # In front of a question's fields stand its own place and its kind.
    names = fault["loc"][2:] or fault["loc"] or ("want",)
    where = ".".join(str(each) for each in names)
    why = fault["msg"][:1].lower() + fault["msg"][1:]
    try:
        return complaint(where[:200], fault["input"], why, "change it")
    except RecursionError:
        return complaint(where[:200], "a nested value", why, "change it")
