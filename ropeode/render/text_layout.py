"""Paragraphs and columns for a terminal of 80 columns."""

from __future__ import annotations

import textwrap
from collections.abc import Collection, Sequence

from tabulate import tabulate

WIDTH = 80


def wrapped(text: str, indent: int = 0) -> list[str]:
    """The lines of a paragraph, those after the first indented a little more.

    Arguments:
        text: of the paragraph.
        indent: of the first line; without one, no line is indented.
    """
    return textwrap.wrap(
        text,
        WIDTH,
        initial_indent=" " * indent,
        subsequent_indent=" " * (indent + 2 * bool(indent)),
    )


def hanging(head: str, text: str) -> list[str]:
    """The lines of a paragraph that begins behind `head` and stays to the right of it."""
    return textwrap.wrap(text, WIDTH, initial_indent=head, subsequent_indent=" " * len(head))


def columns(rows: Sequence[Sequence[str]], left: Collection[int] | None = None) -> list[str]:
    """The lines of a table.

    Arguments:
        rows: cells as text; the headers are the first row.
        left: the columns whose text is flush left, by default all of them.
    """
    sides = ["left" if left is None or i in left else "right" for i in range(len(rows[0]))]
    # tabulate pads headers, which would make tables too wide: for it they are a row like others.
    table = tabulate(rows, tablefmt="plain", disable_numparse=True, colalign=sides)
    return [line.rstrip() for line in table.splitlines()]
