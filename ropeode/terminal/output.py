"""The options --format and --out, and where the result of a command goes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from ropeode.files import check_writable, write_whole
from ropeode.terminal.running import not_interrupted

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


class WritablePath(click.ParamType):
    """The path of a file that can be written to, checked before anything is computed."""

    name = "file"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        """The path; raises InputError where no file can be written."""
        return check_writable(param.name if param and param.name else "out", value)


def out_option(what: str) -> Callable[[Callable], Callable]:
    """The option --out of a command that prints what is named."""
    words = f"Write the {what} to FILE and print nothing."
    return click.option("--out", metavar="FILE", type=WritablePath(), help=words)


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


def put_out(text: str, path: Path | None) -> None:
    """Write a result to its file, whole, or print it if there is no file."""
    if path is None:
        click.echo(text, nl=False)
        return
    with not_interrupted():
        write_whole(path, text)
