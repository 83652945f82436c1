"""The parts of a docstring: what is described, its arguments, its source."""

from __future__ import annotations

import inspect
import re
from typing import Any


def description(documented: Any) -> list[str]:
    """The paragraphs before arguments and sources are listed, each in one line."""
    text = inspect.getdoc(documented) or ""
    text = re.split(r"^(?:Arguments:|Raises:|Source:|Examples:)", text, flags=re.MULTILINE)[0]
    return [" ".join(each.split()) for each in text.strip().split("\n\n")]


def argument_words(documented: Any) -> dict[str, str]:
    """What is said of each argument, or field, in one line; of a class, by its bases too."""
    if inspect.isclass(documented):
        words: dict[str, str] = {}
        for each in reversed(documented.__mro__):
            words |= _words_of(each.__doc__)
        return words
    return _words_of(documented.__doc__)


def _words_of(docstring: str | None) -> dict[str, str]:
    text = inspect.cleandoc(docstring or "")
    _, *after = re.split(r"^(?:Arguments|Fields):\n", text, maxsplit=1, flags=re.MULTILINE)
    section = "".join(after).partition("\n\n")[0]
    entries = re.split(r"^    (\w+): ", section, flags=re.MULTILINE)[1:]
    return {
        name: " ".join(words.split()).rstrip(".")
        for name, words in zip(entries[::2], entries[1::2], strict=True)
    }


def source(documented: Any) -> str:
    """What is given as the source, in one line."""
    text = (inspect.getdoc(documented) or "").partition("Source: ")[2]
    return " ".join(text.partition("\n\n")[0].split())
