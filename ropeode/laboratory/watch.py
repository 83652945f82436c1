"""The file that the lab was opened with, and what it imports: a new version once one is saved.

The file is only read here; the worker runs it.
"""

from __future__ import annotations

import asyncio
import hashlib
import importlib.util
import secrets
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

_LOOKS_AGAIN_S = 0.2


class Version(NamedTuple):
    """A version of a file.

    Fields:
        name: of the version. Another run of the lab has other names, so no page takes what it
            knows from an earlier run for an answer about this one.
        text: of the file; empty where it cannot be read.
        fault: why not; None where it can.
        beside: hash of what it imports.
    """

    name: str
    text: str
    fault: str | None
    beside: str


class WatchedFile:
    """A Python file, and the files that it imports.

    Arguments:
        path: of the file.
    """

    def __init__(self, path: Path) -> None:
        self._path, self._salt = path, secrets.token_bytes()
        self._beside: dict[Path, str] = {}
        self._marks = self._looked_at()
        self.newest = self._read()

    def import_from(self, files: Iterable[Path]) -> None:
        """Watch these as well: the newest version has imported them."""
        self._beside |= {path: hash_of(path) for path in files if path not in self._beside}
        self._marks = self._looked_at()
        self.newest = self.newest._replace(beside=self._hash_beside())

    async def changed(self) -> Version:
        """The next version."""
        before = self._marks
        while True:
            await asyncio.sleep(_LOOKS_AGAIN_S)
            now = self._looked_at()
            # A file that is being written is left alone.
            if now == before and now != self._marks:
                self._marks = now
                for path in self._beside:
                    self._beside[path] = hash_of(path)
                newest = self._read()
                if newest.name != self.newest.name:
                    self.newest = newest
                    return newest
            before = now

    def _looked_at(self) -> list[tuple[int, ...] | None]:
        return [_mark(path) for path in (self._path, *self._beside)]

    def _hash_beside(self) -> str:
        parts = [f"{path}={found}" for path, found in sorted(self._beside.items())]
        return hashlib.sha256("\n".join(parts).encode()).hexdigest()

    def _read(self) -> Version:
        contents, text, fault = b"", "", None
        try:
            contents = self._path.read_bytes()
            # As Python reads it: a comment may name the encoding.
            text = importlib.util.decode_source(contents)
        except (OSError, SyntaxError, UnicodeDecodeError) as error:
            fault = f"{self._path} cannot be read: {error}"
        beside = self._hash_beside()
        digest = hashlib.sha256(self._salt + contents + beside.encode() + (fault or "").encode())
        return Version(digest.hexdigest()[:16], text, fault, beside)


def watched_path(where: str) -> Path:
    """The file of ``FILE.py:NAME`` or ``FILE.py``."""
    return Path(where if where.endswith(".py") else where.rpartition(":")[0])


def _mark(path: Path) -> tuple[int, ...] | None:
    try:
        found = path.stat()
    except OSError:
        return None
    # A tool may set the first of these back, and not the second.
    return found.st_mtime_ns, found.st_ctime_ns, found.st_size


def hash_of(path: Path) -> str:
    """Of the contents of a file; empty if it cannot be read."""
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError:
        return ""
