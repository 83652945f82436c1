"""A sha256 of a whole file, at its end.

HDF5 does not look behind its own data, so that other programs can read a file with a checksum. A
change anywhere in the file is detected here, before HDF5 reads any of it.
"""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

from ropeode.errors import InputError
from ropeode.files import open_to_read, unreadable
from ropeode.validation import bad_value

_MARK = b"\nropeode sha256 "
_LENGTH = len(_MARK) + 64 + 1
_CHUNK_BYTES = 2**20


def with_checksum(contents: bytes) -> bytes:
    """The contents of a file with their checksum at the end."""
    return b"".join([contents, _MARK, hashlib.sha256(contents).hexdigest().encode(), b"\n"])


def verify_checksum(path: Path) -> str:
    """Verify that a file is as it was written, and return its checksum.

    Raises:
        InputError: it cannot be read, has no checksum, or has another one.
    """
    with open_to_read("reference", path) as file:
        size = os.fstat(file.fileno()).st_size
        digest, left = hashlib.sha256(), size - _LENGTH
        try:
            while left > 0 and (piece := file.read(min(_CHUNK_BYTES, left))):
                digest.update(piece)
                left -= len(piece)
            end = file.read(_LENGTH)
        except OSError as error:
            raise unreadable("reference", path, error.strerror) from error
    if not end.startswith(_MARK) or not end.endswith(b"\n"):
        raise unusable(path, "a file that ropeode wrote whole (the checksum at its end is missing)")
    if end[len(_MARK) : -1] != digest.hexdigest().encode():
        raise unusable(
            path, "a file as it was written (its sha256 differs from the one at its end)"
        )
    return digest.hexdigest()


def unusable(path: Path, allowed: str) -> InputError:
    """The complaint about a file that is not as it was written, to be raised."""
    fix = "do not use it; write it again, or download it again"
    return bad_value("reference", str(path), allowed, fix)
