"""What a submission is: a Python file or a subfolder with one, or a subfolder of trajectories."""

from __future__ import annotations

import ast
import hashlib
import os
from collections.abc import Collection, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from ropeode.checking import FORMATS
from ropeode.validation import bad_value

# What a stepper of one's own needs of ropeode, at most.
_OWN = "ropeode"
_BASE_CLASS = "Stepper"
# So many bytes of Python are parsed: it takes a thousand times as much memory.
_LONGEST = 2**20


class Submission(NamedTuple):
    """One submission.

    Fields:
        name: of the file without its suffix, or of the subfolder.
        where: its files from the folder on, of a stepper ``FILE.py`` or ``FILE.py:NAME``; none
            where nobody can tell.
        trouble: why there is none; empty where there is one.
        digest: of the contents of all its files that count.
        marks: what a reader of the grade book should know of the text.
    """

    name: str
    where: tuple[str, ...]
    trouble: str
    digest: str
    marks: tuple[str, ...] = ()


def stepper_submissions(
    folder: Path, name: str | None = None, without: Path | None = None
) -> list[Submission]:
    """The steppers of a folder, by the names of their submissions.

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
    for path in _entries(folder, without):
        if not (path.is_dir() or path.suffix == ".py"):
            continue
        files = _files(path, (".py",))
        stepper, trouble = _stepper_of(path, files, file)
        submission = _submission(path, files, [stepper] if stepper else [], trouble)
        if function:
            where = tuple(f"{each}:{function}" for each in submission.where)
            submission = submission._replace(where=where)
        if submission.digest:
            submission = submission._replace(marks=tuple(_marks(files)))
        found.append(submission)
    if not found:
        fix = "put a file FILE.py, or a subfolder with one, into it for each submission"
        raise bad_value("step", str(folder), "a folder with submissions; this one has none", fix)
    return _with_names_of_their_own(found)


def trajectory_submissions(folder: Path, without: Path | None = None) -> list[Submission]:
    """The trajectories of a folder, by the names of their submissions.

    Arguments:
        folder: holds a subfolder for each; hidden ones, and those that begin with ``_``, do not
            count.
        without: as for `stepper_submissions`.

    Raises:
        InputError: there is no submission.
    """
    found = []
    for path in _entries(folder, without):
        if path.is_dir():
            files = _files(path, FORMATS)
            trouble = f"there is no file in the folder {path.name} that ends in "
            trouble = "" if files else f"{trouble}{', '.join(FORMATS)}"
            found.append(_submission(path, files, files, trouble))
    if not found:
        allowed = "a folder with a subfolder for each submission; this one has none"
        fix = "make them, or name the files of one program, as in `ropeode grade mine/*.csv`"
        raise bad_value("files", str(folder), allowed, fix)
    return found


def _entries(folder: Path, without: Path | None) -> Iterator[Path]:
    for path in sorted(folder.iterdir()):
        # Not by `resolve`, to which a link to itself is a bug.
        own = without is not None and os.path.realpath(path) == os.path.realpath(without)
        if not (own or path.name.startswith((".", "_"))):
            yield path


def _files(path: Path, suffixes: Collection[str]) -> list[Path]:
    """The files of a submission that count."""
    if not path.is_dir():
        return [path]
    return sorted(
        each
        for each in path.rglob("*")
        if each.suffix.lower() in suffixes
        and each.is_file()
        and not any(part.startswith((".", "_")) for part in each.relative_to(path).parts)
    )


def _submission(
    path: Path, files: Sequence[Path], taken: Sequence[Path], trouble: str
) -> Submission:
    """A submission with these files, of which some are taken.

    The digest is empty where they cannot be read.
    """
    folder, digest = path.parent, hashlib.sha256()
    name = printable(path.name if path.is_dir() else path.stem)
    try:
        for each in files:
            if each.exists() and not each.is_file():
                # Whoever reads a pipe may wait for ever.
                return Submission(name, (), f"{each.name} is no regular file", "")
            with each.open("rb") as file:
                own = hashlib.file_digest(file, "sha256").hexdigest()
            digest.update(f"{printable(str(each.relative_to(folder)))}\0{own}\0".encode())
    except OSError as error:
        return Submission(name, (), f"{each.name} cannot be read ({error.strerror})", "")
    where = tuple(str(each.relative_to(folder)) for each in taken)
    return Submission(name, where, trouble, digest.hexdigest())


def _parts(name: str | None) -> tuple[str | None, str | None]:
    """The file and the function of ``FILE.py:NAME``; None for what is left open."""
    file, _, function = (name or "").rpartition(":")
    if name is not None and not (function.isidentifier() and (not file or file.endswith(".py"))):
        fix = "for example --name verlet_step"
        raise bad_value("name", name, "NAME of a function or class, or FILE.py:NAME", fix)
    return file or None, function or None


def _stepper_of(path: Path, files: Sequence[Path], file: str | None) -> tuple[Path | None, str]:
    """The file of a submission, or why there is none."""
    if not path.is_dir():
        return path, ""
    if file is not None:
        if (path / file).is_file():
            return path / file, ""
        return None, f"there is no file {file} in the folder {path.name}"
    if len(files) == 1:
        return files[0], ""
    if not files:
        return None, f"there is no Python file in the folder {path.name}"
    listed = ", ".join(str(each.relative_to(path)) for each in files[:5])
    listed += ", ..." if len(files) > 5 else ""
    return None, (
        f"there are {len(files)} Python files in the folder {path.name} ({listed}); "
        "--name FILE.py:NAME says which to take"
    )


def printable(text: str) -> str:
    """Text in one line, with escapes for what is no letter, as in a name that is not UTF-8."""
    return "".join(
        each if each.isprintable() else each.encode("unicode_escape").decode() for each in text
    )


def _marks(files: Sequence[Path]) -> Iterator[str]:
    """What a submission takes from ropeode: a reader may want to look at it."""
    taken: set[str] = set()
    for file in files:
        if file.stat().st_size > _LONGEST:
            yield f"{printable(file.name)} is too long to be looked through"
            continue
        try:
            tree = ast.parse(file.read_bytes())
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            # Nested too deeply for Python's parser, among others.
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
        if names.count(each.name.casefold()) > 1 and each.where and "/" not in each.where[0]
        else each
        for each in found
    ]
