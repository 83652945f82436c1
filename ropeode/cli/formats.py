"""The option --format, and the suffixes that stand for it."""

from __future__ import annotations

from pathlib import Path

import click

# The names in ropeode.render.formats and the suffixes that stand for them; a test holds the
# two together. Listed here because the help text must not import what makes tables.
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
    help="Default: by the suffix of --out, or else text.",
)


def format_for(chosen: str | None, path: Path | None) -> str:
    """The format that was chosen, or else that of the file's suffix, or else text."""
    suffixes = {suffix: name for name, suffix in FORMATS.items()}
    return chosen or (suffixes.get(path.suffix, "text") if path else "text")
