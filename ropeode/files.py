"""Files that are written whole or not at all, and read only if their size is no danger."""

from __future__ import annotations

import contextlib
import fcntl
import functools
import os
import re
import stat
import tempfile
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any, BinaryIO

from ropeode.errors import InputError
from ropeode.validation import bad_value, cut

# Where this variable is set, no user's file is run. Processes that a command starts inherit it.
NO_CODE = "ROPEODE_NO_CODE"

# The name of a part of a file, as `tempfile` makes it.
_PART = re.compile(r"\..+\.[a-z0-9_]{8}\.part")
# Of what is read at once. TOML is written by hand, or nearly so.
_MOST_BYTES, _MOST_TOML = 2**28, 2**20
# Parsing nested values takes stack, and a key of many parts takes memory by the square of them.
_MOST_NESTED, _MOST_PARTS, _LONGEST_WORD = 16, 16, 100
_TOML_TOKEN = re.compile(
    r'''"""(?:[^"\\]|\\.|"(?!""))*+(?:"""|\Z) | '{3}.*?(?:'{3}|\Z)
    | "(?:[^"\\\n]|\\.)*+"? | '[^'\n]*'? | \#[^\n]* | [\w+-]+ | [][{}.,=\n]''',
    re.DOTALL | re.VERBOSE,
)
_BETWEEN_KEYS = frozenset("[]{},=\n")


def refuse_code(name: str, path: str | Path) -> None:
    """Raises:
    InputError: no code may be run.
    """
    if os.environ.get(NO_CODE):
        allowed = f"no Python file, with --no-code or the variable {NO_CODE}"
        raise bad_value(name, str(path), allowed, "read the file; if you trust it, allow code")


def check_writable(name: str, path: str | Path) -> Path:
    """A path that a file can be written to, checked before anything is computed.

    Arguments:
        name: what to call it in the complaint.
        path: of the file, which may exist.

    Raises:
        InputError: its folder does not exist or cannot be written to, or it is a folder.
    """
    path = Path(path)
    folder = path.parent
    if not folder.is_dir():
        raise bad_value(
            name, str(path), "a file in a folder that exists", f"create {str(folder)!r}"
        )
    if path.is_dir():
        raise bad_value(name, str(path), "a file", "add a file name; this is a folder")
    if not os.access(path if _is_special(path) else folder, os.W_OK):
        raise bad_value(name, str(path), "a folder that you may write to", "choose another folder")
    return path


def check_suffix(name: str, path: str | Path, suffixes: Iterable[str], then: str = "") -> Path:
    """A path with one of some suffixes that a file can be written to.

    Arguments:
        name: what to call it in the complaint.
        path: of the file, which may exist.
        suffixes: that are allowed, as in ``.png``.
        then: what else helps, for the end of the complaint.

    Raises:
        InputError: it has another suffix, or cannot be written to.
    """
    allowed = list(suffixes)
    if Path(path).suffix.lower() not in allowed:
        ends = f"a file name that ends in {', '.join(allowed)}"
        fix = f"for example {Path(path).stem or 'result'}{allowed[0]}{then}"
        raise bad_value(name, str(path), ends, fix)
    return check_writable(name, path)


def _is_special(path: Path) -> bool:
    """Whether it is a pipe or a device, such as /dev/stdout, which cannot be replaced."""
    return path.exists() and not path.is_file()


def write_whole(path: Path, contents: str | bytes) -> None:
    """Write a file so that at any moment the old one or the new one is there, whole.

    What a link leads to is replaced, not the link; a pipe or a device is written to.

    Arguments:
        path: of the file, which may exist.
        contents: bytes, or text, which is written as UTF-8.

    Raises:
        InputError: the operating system refuses; no part of the file is left behind.
    """
    if isinstance(contents, str):
        contents = contents.encode()
    part = None
    try:
        if _is_special(path):
            path.write_bytes(contents)
            return
        target = path.resolve()
        handle, part = _new_part(target)
        with open(handle, "wb") as file:
            file.write(contents)
            file.flush()
            os.fsync(file.fileno())
        mask = os.umask(0)
        os.umask(mask)
        os.chmod(part, 0o666 & ~mask)
        os.replace(part, target)
    except OSError as error:
        raise bad_value(
            "out",
            str(path),
            f"a file that can be written ({error.strerror or error})",
            "choose another",
        ) from error
    finally:
        if part is not None:
            with contextlib.suppress(FileNotFoundError):
                os.unlink(part)


@functools.cache
def _remove_parts(folder: Path) -> None:
    """Remove, once in each process, the parts of files that killed processes left in a folder."""
    for part in folder.glob(".*.part"):
        if not (_PART.fullmatch(part.name) and part.is_file()):
            continue
        # Whoever writes to it holds the lock.
        with contextlib.suppress(OSError), part.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            part.unlink()


def _new_part(target: Path) -> tuple[int, str]:
    """A new file beside another, open and locked."""
    _remove_parts(target.parent)
    while True:
        handle, part = tempfile.mkstemp(".part", f".{target.name}.", target.parent)
        # Some file systems have no locks: what is left there stays.
        with contextlib.suppress(OSError):
            fcntl.flock(handle, fcntl.LOCK_EX)
        # Another process may have removed it before it was locked.
        if os.fstat(handle).st_nlink:
            return handle, part
        os.close(handle)


def make_folder(path: Path) -> None:
    """Create a folder, and those above it, if they do not exist.

    Raises:
        InputError: the operating system refuses.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        allowed = f"a folder that can be created ({error.strerror})"
        raise bad_value("out", str(path), allowed, "choose another") from error


def unreadable(name: str, path: str | Path, why: object) -> InputError:
    """The complaint about a file that cannot be read, to be raised."""
    return bad_value(name, str(path), f"a file that can be read ({why})", "check the path")


def open_to_read(name: str, path: str | Path) -> BinaryIO:
    """Open a file that exists on a disk, whose size is known.

    Raises:
        InputError: it cannot be opened, or is something else, as a pipe or a device.
    """
    try:
        # A pipe would keep us waiting until somebody writes to it.
        handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    except (OSError, ValueError) as error:
        raise unreadable(name, path, getattr(error, "strerror", None) or error) from error
    if not stat.S_ISREG(os.fstat(handle).st_mode):
        os.close(handle)
        raise unreadable(name, path, "it is a folder, a pipe or a device, not a file")
    return os.fdopen(handle, "rb")


def read_bytes(name: str, path: str | Path) -> bytes:
    """The contents of a file.

    Raises:
        InputError: it cannot be read, is no file, or is too long.
    """
    with open_to_read(name, path) as file:
        try:
            # Not the size that it says: some files grow, and some say none.
            contents = file.read(_MOST_BYTES + 1)
        except OSError as error:
            raise unreadable(name, path, error.strerror) from error
    if len(contents) > _MOST_BYTES:
        raise unreadable(name, path, f"it has more than {_MOST_BYTES} bytes")
    return contents


def read_text(name: str, path: str | Path) -> str:
    """The text of a file, with lines that end as in Unix.

    Raises:
        InputError: as `read_bytes`, or it is not UTF-8 text.
    """
    try:
        # Editors on Windows may put a byte order mark before the text.
        text = read_bytes(name, path).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise unreadable(name, path, "it is not UTF-8 text") from error
    return text.replace("\r\n", "\n").replace("\r", "\n")


def read_toml(name: str, path: str | Path, example: str) -> dict[str, Any]:
    """A TOML file as nested values.

    Arguments:
        name: what to call it in the complaint.
        path: of the file.
        example: where to see a right one.

    Raises:
        InputError: as `parse_toml`, or the file cannot be read.
    """
    return parse_toml(name, path, read_text(name, path), example)


def parse_toml(name: str, path: str | Path, text: str, example: str) -> dict[str, Any]:
    """The text of a TOML file as nested values; arguments are those of `read_toml`.

    Raises:
        InputError: it is not TOML, or nested too deeply, or has too long a key or number.
    """
    try:
        _check_toml(text)
        return tomllib.loads(text)
    except ValueError as error:
        raise bad_value(
            name, str(path), f"a TOML file ({cut(str(error))})", f"see {example}"
        ) from error


def _check_toml(text: str) -> None:
    """Raises:
    ValueError: a parser would take much stack or memory for the text.
    """
    if len(text) > _MOST_TOML:
        raise ValueError(f"of at most {_MOST_TOML} characters; this has {len(text)}")
    nested = parts = 0
    for match in _TOML_TOKEN.finditer(text):
        token, why = match[0], ""
        nested += (token in ("[", "{")) - (token in ("]", "}"))
        parts = 0 if token in _BETWEEN_KEYS else parts + (token == ".")
        if nested > _MOST_NESTED:
            why = f"arrays and tables in one another, more than {_MOST_NESTED} deep"
        elif parts >= _MOST_PARTS:
            why = f"a key of more than {_MOST_PARTS} parts"
        elif len(token) > _LONGEST_WORD and token[0] not in "\"'#":
            why = f"a key or number of {len(token)} characters, where {_LONGEST_WORD} are allowed"
        if why:
            line = text.count("\n", 0, match.start()) + 1
            raise ValueError(f"{why} (at line {line})")
