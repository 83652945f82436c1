"""The formats that a table can be written in, by name."""

from __future__ import annotations

from collections.abc import Callable

from ropeode.render.data import as_csv, as_json
from ropeode.render.documents import as_html, as_latex, as_markdown
from ropeode.render.plain_text import as_text
from ropeode.study.accuracy_table import AccuracyTable

FORMATS: dict[str, Callable[[AccuracyTable], str]] = {
    "text": as_text,
    "markdown": as_markdown,
    "latex": as_latex,
    "csv": as_csv,
    "json": as_json,
    "html": as_html,
}
