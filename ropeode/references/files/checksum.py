"""A sha256 of all that a file holds, at its end.

HDF5 does not look behind its own data, so that other programs read a sealed file as it is.
What has been changed anywhere is found out here, before HDF5 sees any of it.
"""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

from ropeode.errors import InputError
from ropeode.validation import complaint

_MARK = b"\nropeode sha256 "
_LENGTH = len(_MARK) + 64 + 1
_CHUNK_BYTES = 2**20


def seal(path: Path) -> str:
    """Append the seal to a file, and give the digest.

    Arguments:
        path: of a file without one.
    """
    digest = _digest(path, path.stat().st_size)
    with path.open("ab") as file:
        file.write(_MARK + digest.encode() + b"\n")
        file.flush()
        os.fsync(file.fileno())
    return digest


def check_seal(path: Path) -> str:
    """See that a file is as it was written, and give its digest.

    Arguments:
        path: of a sealed file.

    Raises:
        InputError: it cannot be read, has no seal, or is not what was sealed.
    """
    try:
        size = path.stat().st_size
        with path.open("rb") as file:
            file.seek(max(0, size - _LENGTH))
            end = file.read(_LENGTH)
        if not end.startswith(_MARK) or not end.endswith(b"\n"):
            raise InputError(
                complaint(
                    "reference",
                    str(path),
                    "a file that ropeode wrote whole (the seal at its end is missing)",
                    "write it again, or fetch it again",
                )
            )
        digest = _digest(path, size - _LENGTH)
    except OSError as error:
        raise InputError(
            complaint(
                "reference", str(path), f"a file that can be read ({error.strerror})", "check it"
            )
        ) from error
    if end[len(_MARK) : -1] != digest.encode():
        raise InputError(
            complaint(
                "reference",
                str(path),
                "a file as it was written (its sha256 is another one than its seal says)",
                "do not use it; write it again, or fetch it again",
            )
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
