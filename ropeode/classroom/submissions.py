"""What a submission is: a Python file of a folder, or a subfolder with one."""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from ropeode.validation import bad_value

# What a stepper of one's own needs of ropeode, at most.
_OWN = "ropeode"
_BASE_CLASS = "Stepper"


class Submission(NamedTuple):
    """One submission.

    Fields:
        name: of the file without its suffix, or of the subfolder.
        where: its stepper, as ``FILE.py`` or ``FILE.py:NAME`` from the folder on; None where
            nobody can tell.
        trouble: why there is none; empty where there is one.
        digest: of the texts of all its Python files.
        marks: what a reader of the grade book should know of the text.
    """

    name: str
    where: str | None
    trouble: str
    digest: str
    marks: tuple[str, ...] = ()


def submissions_in(
    folder: Path, name: str | None = None, without: Path | None = None
) -> list[Submission]:
    """The submissions of a folder, by name.

    Arguments:
        folder: holds Python files and subfolders; hidden ones, and those that begin with ``_``,
            do not count.
        name: of the function or class, ``NAME``; or ``FILE.py:NAME``, with the file to take in
            subfolders.
        without: a folder that is no submission, though it may be in this one.

    Raises:
        InputError: there is no submission, or the name is of another form.
    """
    file, function = _parts(name)
    found = []
    for path in sorted(folder.iterdir()):
        if path.name.startswith((".", "_")) or not (path.is_dir() or path.suffix == ".py"):
            continue
        if without is not None and path.resolve() == without.resolve():
            continue
        files = sorted(_python_files(path)) if path.is_dir() else [path]
        where, trouble = _stepper_of(path, files, file)
        digest = hashlib.sha256()
        try:
            texts = [each.read_bytes() for each in files]
        except OSError as error:
            where, trouble, texts = None, f"{path.name} cannot be read ({error.strerror})", []
        for each, text in zip(files, texts, strict=False):
            digest.update(f"{each.relative_to(folder)}\0".encode() + text + b"\0")
        found.append(
            Submission(
                path.name.removesuffix(".py"),
                where and ":".join(filter(None, (str(Path(where).relative_to(folder)), function))),
                trouble,
                digest.hexdigest(),
                tuple(_marks(texts)),
            )
        )
    if not found:
        fix = "put a file FILE.py, or a subfolder with one, into it for each submission"
        raise bad_value("step", str(folder), "a folder with submissions; this one has none", fix)
    return _with_names_of_their_own(found)


def _parts(name: str | None) -> tuple[str | None, str | None]:
    """The file and the function of ``FILE.py:NAME``; None for what is left open."""
    file, _, function = (name or "").rpartition(":")
    if name is not None and not (function.isidentifier() and (not file or file.endswith(".py"))):
        fix = "for example --name verlet_step"
        raise bad_value("name", name, "NAME of a function or class, or FILE.py:NAME", fix)
    return file or None, function or None


def _python_files(folder: Path) -> Iterator[Path]:
    for path in folder.rglob("*.py"):
        inside = path.relative_to(folder).parts
        if path.is_file() and not any(part.startswith((".", "_")) for part in inside):
            yield path


def _stepper_of(path: Path, files: list[Path], file: str | None) -> tuple[str | None, str]:
    """The file of a submission, or why there is none."""
    if not path.is_dir():
        return str(path), ""
    if file is not None:
        if (path / file).is_file():
            return str(path / file), ""
        return None, f"there is no file {file} in the folder {path.name}"
    if len(files) == 1:
        return str(files[0]), ""
    if not files:
        return None, f"there is no Python file in the folder {path.name}"
    listed = ", ".join(str(each.relative_to(path)) for each in files[:5])
    listed += ", ..." if len(files) > 5 else ""
    return None, (
        f"there are {len(files)} Python files in the folder {path.name} ({listed}); "
        "--name FILE.py:NAME says which to take"
    )


def _marks(texts: list[bytes]) -> Iterator[str]:
    """What a submission takes from ropeode: a reader may want to look at it."""
    taken: set[str] = set()
    for text in texts:
        try:
            tree = ast.parse(text)
        except (SyntaxError, ValueError, RecursionError):
            continue
        for node in ast.walk(tree):
            if isinstance(node, ast.Import):
                taken |= {each.name for each in node.names if each.name.split(".")[0] == _OWN}
            elif isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == _OWN:
                taken |= {each.name for each in node.names}
    if taken := taken - {_BASE_CLASS}:
        yield f"imports {', '.join(sorted(taken))} of ropeode"


def _with_names_of_their_own(found: list[Submission]) -> list[Submission]:
    """A file `anna.py` beside a folder `anna` keeps its suffix; names are those of pages."""
    names = [each.name.casefold() for each in found]
    return [
        each._replace(name=f"{each.name}.py")
        if names.count(each.name.casefold()) > 1 and each.where and "/" not in each.where
        else each
        for each in found
    ]
