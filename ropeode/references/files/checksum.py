"""A sha256 of a whole file, at its end.

HDF5 does not look behind its own data, so that other programs can read a file with a checksum. A
change anywhere in the file is detected here, before HDF5 reads any of it.
"""

from __future__ import annotations

import hashlib
from pathlib import Path

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
    try:
        size = path.stat().st_size
        with path.open("rb") as file:
            file.seek(max(0, size - _LENGTH))
            end = file.read(_LENGTH)
        if not end.startswith(_MARK) or not end.endswith(b"\n"):
            raise bad_value(
                "reference",
                str(path),
                "a file that ropeode wrote whole (the checksum at its end is missing)",
                "write it again, or download it again",
            )
        digest = _digest(path, size - _LENGTH)
    except OSError as error:
        raise bad_value(
            "reference", str(path), f"a file that can be read ({error.strerror})", "check it"
        ) from error
    if end[len(_MARK) : -1] != digest.encode():
        raise bad_value(
            "reference",
            str(path),
            "a file as it was written (its sha256 differs from the one at its end)",
            "do not use it; write it again, or download it again",
        )
    return digest


def _digest(path: Path, size: int) -> str:
    """The sha256 of the first bytes of a file, read in pieces."""
    digest = hashlib.sha256()
    with path.open("rb") as file:
        left = size
        while left > 0 and (piece := file.read(min(_CHUNK_BYTES, left))):
            digest.update(piece)
            left -= len(piece)
    return digest.hexdigest()
