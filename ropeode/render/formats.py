"""The formats that a table can be written in, by name."""

from __future__ import annotations

from collections.abc import Callable

from ropeode.errors import InputError
from ropeode.render.data import as_csv, as_json
from ropeode.render.documents import as_html, as_latex, as_markdown
from ropeode.render.plain_text import as_text
from ropeode.study.accuracy_table import AccuracyTable
from ropeode.validation import unknown

FORMATS: dict[str, Callable[[AccuracyTable], str]] = {
    "text": as_text,
    "markdown": as_markdown,
    "latex": as_latex,
    "csv": as_csv,
    "json": as_json,
    "html": as_html,
}


def format_table(table: AccuracyTable, form: str = "text") -> str:
    """A table as text.

    Arguments:
        table: from `ropeode.accuracy_table`.
        form: one of `FORMATS`.

    Raises:
        InputError: there is no such format.
    """
    if form not in FORMATS:
        raise InputError(unknown("format", form, FORMATS))
    return FORMATS[form](table)
