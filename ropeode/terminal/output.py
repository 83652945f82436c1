"""The options --format, --out and --plots, and where the result of a command goes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import click

from ropeode.errors import InputError
from ropeode.files import check_writable, write_whole
from ropeode.terminal.running import not_interrupted
from ropeode.validation import bad_value

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


class Written(click.Path):
    """A path that is written to, checked before anything is computed.

    Arguments:
        check: called with the option's name and the path; raises InputError if it is of no use.
    """

    def __init__(self, check: Callable[[str, str], Path]):
        super().__init__()
        self._check = check

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        """The path that was checked."""
        return self._check(param.name if param and param.name else "out", value)


def out_option(what: str) -> Callable[[Callable], Callable]:
    """The option --out of a command that prints what is named."""
    return out_option_with(
        f"Write the {what} to FILE and print nothing.", type=Written(check_writable)
    )


def out_option_with(words: str, **named: Any) -> Callable[[Callable], Callable]:
    """The option --out of a command that always writes, whose suffixes it checks itself.

    Arguments:
        words: what help says of it.
        named: as for `click.option`.
    """
    defaults = {"metavar": "FILE", "type": click.Path()}
    return click.option("-o", "--out", help=words, **{**defaults, **named})


format_option = click.option(
    "--format",
    "form",
    type=click.Choice(list(FORMATS)),
    help="[by the suffix of --out, else text]",
)


def format_for(chosen: str | None, path: Path | None) -> str:
    """The format that was chosen, or else that of the file's suffix; text where there is none.

    Raises:
        InputError: the suffix is none of ours, and no format was chosen.
    """
    suffixes = {suffix: name for name, suffix in FORMATS.items()}
    if chosen or path is None or not path.suffix:
        return chosen or "text"
    if path.suffix.lower() not in suffixes:
        ends = f"a file name that ends in {', '.join(suffixes)}"
        raise bad_value("out", str(path), ends, f"rename it, or add --format {next(iter(FORMATS))}")
    return suffixes[path.suffix.lower()]


def put_out(text: str, path: Path | None) -> None:
    """Write a result to its file, whole, or print it if there is no file."""
    if path is None:
        click.echo(text, nl=False)
        return
    with not_interrupted():
        write_whole(path, text)


def check_folder(name: str, given: str) -> Path:
    """A folder for pictures that exists or can be created.

    Arguments:
        name: of the option that names it.
        given: its path.

    Raises:
        InputError: no file can be written there.
    """
    folder = Path(given)
    try:
        if folder.exists():
            check_writable(name, folder / "figure.png")
        else:
            folder.mkdir()
            folder.rmdir()
    except (OSError, InputError) as error:
        allowed = "a folder that you may write to, or the name of a new one in such a folder"
        raise bad_value(name, given, allowed, "choose another folder") from error
    return folder


def plots_option(words: str) -> Callable[[Callable], Callable]:
    """The option --plots of a command that has pictures besides its text; help says `words`."""
    return click.option("--plots", metavar="DIR", type=Written(check_folder), help=words)


def put_pictures(pictures: Mapping[str, bytes], folder: Path) -> None:
    """Write pictures to files of a folder, which is made if need be, and say so."""
    with not_interrupted():
        folder.mkdir(exist_ok=True)
        for name, contents in pictures.items():
            write_whole(folder / name, contents)
    many = "1 picture" if len(pictures) == 1 else f"{len(pictures)} pictures"
    click.echo(f"wrote {many} to {folder}", err=True)
