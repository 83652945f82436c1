"""The cache folder of a command, whose files carry their checksum."""

from __future__ import annotations

import contextlib
import hashlib
from pathlib import Path

from ropeode.errors import InputError
from ropeode.files import write_whole

_folder: Path | None = None


def keep_in(folder: Path) -> None:
    """Keep what takes long to make in a folder from now on, and read it from there.

    No result changes: what is read is what would be made anew.

    Arguments:
        folder: created when the first file is written.
    """
    global _folder
    _folder = folder


def is_used() -> bool:
    """Whether there is such a folder; a call from Python has none."""
    return _folder is not None


def read(name: str) -> bytes | None:
    """The contents of a file; None if there is no file, or its checksum is wrong."""
    if _folder is None:
        return None
    try:
        digest, contents = (_folder / name).read_bytes().split(b"\n", 1)
    except (OSError, ValueError):
        return None
    return contents if hashlib.sha256(contents).hexdigest().encode() == digest else None


def write(name: str, contents: bytes) -> None:
    """Keep a file; if the folder is not writable, the next process makes it again."""
    if _folder is None:
        return
    with contextlib.suppress(OSError, InputError):
        path = _folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, hashlib.sha256(contents).hexdigest().encode() + b"\n" + contents)
