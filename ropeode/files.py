"""Files that are written whole or not at all."""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Iterable
from pathlib import Path

from ropeode.validation import bad_value

# Where this variable is set, no user's file is run. Processes that a command starts inherit it.
NO_CODE = "ROPEODE_NO_CODE"


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
        handle, part = tempfile.mkstemp(dir=target.parent, prefix=f".{path.name}.", suffix=".part")
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


def read_text(name: str, path: str | Path) -> str:
    """The text of a file.

    Raises:
        InputError: it cannot be read, or is not UTF-8 text.
    """
    try:
        # Editors on Windows may put a byte order mark before the text.
        return Path(path).read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        allowed, fix = "a text file that can be read (it is not UTF-8 text)", "check the path"
        raise bad_value(name, str(path), allowed, fix) from error
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or error
        raise bad_value(
            name, str(path), f"a text file that can be read ({why})", "check the path"
        ) from error


def read_bytes(name: str, path: str | Path) -> bytes:
    """The contents of a file.

    Raises:
        InputError: it cannot be read.
    """
    try:
        return Path(path).read_bytes()
    except (OSError, ValueError) as error:
        allowed = f"a file that can be read ({getattr(error, 'strerror', None) or error})"
        raise bad_value(name, str(path), allowed, "check the path") from error
