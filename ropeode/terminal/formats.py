"""The option --format, and the suffixes that stand for it."""

from __future__ import annotations

from pathlib import Path

import click

# The names in ropeode.render.formats, with their suffixes. They are listed here too because the
# help text must not import the renderers; a test compares the two lists.
FORMATS = {
    "text": ".txt",
    "markdown": ".md",
    "latex": ".tex",
    "csv": ".csv",
    "json": ".json",
    "html": ".html",
}

format_option = click.option(
    "--format",
    "form",
    type=click.Choice(list(FORMATS)),
    help="[by the suffix of --out, else text]",
)


def format_for(chosen: str | None, path: Path | None) -> str:
    """The format that was chosen, or else that of the file's suffix, or else text."""
    suffixes = {suffix: name for name, suffix in FORMATS.items()}
    return chosen or (suffixes.get(path.suffix, "text") if path else "text")
