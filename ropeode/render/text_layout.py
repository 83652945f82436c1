"""Paragraphs and columns for a terminal of 80 columns."""

from __future__ import annotations

import textwrap
from collections.abc import Collection, Sequence

from tabulate import tabulate

TEXT_WIDTH = 80
# Text is not broken into lines shorter than this.
_NARROWEST = 40


def wrapped(text: str, indent: int = 0) -> list[str]:
    """The lines of a paragraph, those after the first indented a little more.

    Arguments:
        text: of the paragraph.
        indent: of the first line; without one, no line is indented.
    """
    return textwrap.wrap(
        text,
        TEXT_WIDTH,
        initial_indent=" " * indent,
        subsequent_indent=" " * (indent + 2 * bool(indent)),
    )


def hanging(head: str, text: str) -> list[str]:
    """The lines of a paragraph that begins behind `head` and stays to the right of it."""
    return textwrap.wrap(text, TEXT_WIDTH, initial_indent=head, subsequent_indent=" " * len(head))


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


def table(
    headers: Sequence[str],
    rows: Sequence[Sequence[str]],
    left: Collection[int],
    long: Collection[int] = (),
) -> list[str]:
    """The lines of a table, whatever it takes to keep within the width.

    A long last column is broken into lines. Other long columns stand below their rows, and if
    that does not do, the first column stands above them, once for rows that share it.

    Arguments:
        headers: of the columns; without a first one there is no line of headers.
        rows: cells as text.
        left: the columns whose text is flush left.
        long: the columns whose text may be broken into lines.
    """
    head = [headers] if headers[0] else []

    def shown(chosen: Sequence[int]) -> list[str]:
        cells = [[row[i] for i in chosen] for row in (*head, *rows)]
        return columns(cells, [at for at, i in enumerate(chosen) if i in left])

    *others, last = range(len(headers))
    if _fits(whole := shown([*others, last])):
        return whole
    if {*long} == {last}:
        begun = shown(others)
        width = max(map(len, begun)) + 2
        if width <= TEXT_WIDTH - _NARROWEST:
            texts = [row[last] for row in (*head, *rows)]
            pairs = zip(begun, texts, strict=True)
            return [each for line, text in pairs for each in hanging(line.ljust(width), text)]
    short = [i for i in range(len(headers)) if i not in long]
    apart = len(short) == 1 or not _fits(shown(short))
    beside = short[1:] if apart else short
    lines = iter(shown(beside) if beside else ())
    written, above = [next(lines) for _ in head if beside], None
    for row in rows:
        if apart and row[0] != above:
            above = row[0]
            written.append(above)
        written += [next(lines)] if beside else []
        for i in sorted(long):
            written += wrapped(f"{headers[i]}: {row[i]}", 4) if row[i] else []
    return written


def _fits(lines: Sequence[str]) -> bool:
    return max(map(len, lines)) <= TEXT_WIDTH
