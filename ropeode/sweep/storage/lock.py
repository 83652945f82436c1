"""One run per folder."""

from __future__ import annotations

import contextlib
import datetime
import json
import os
import socket
from collections.abc import Iterator
from pathlib import Path

from ropeode.errors import InputError
from ropeode.files import write_whole
from ropeode.validation import complaint

LOCK = "lock"
HOLDER = "lock.json"


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold a folder for this process.

    The operating system lets go of the lock when the process ends, however it ends: none is
    ever left over, whatever the note beside it says.

    Arguments:
        folder: that exists.

    Raises:
        InputError: another process holds it; the complaint says which.
    """
    import filelock

    lock = filelock.FileLock(folder / LOCK)
    try:
        lock.acquire(blocking=False)
    except filelock.Timeout:
        raise InputError(
            complaint(
                "folder",
                str(folder),
                f"a folder that no other run is at work in{_holder(folder)}",
                "wait for it, or choose another folder",
            )
        ) from None
    try:
        write_whole(folder / HOLDER, json.dumps(_self()))
        yield
        (folder / HOLDER).unlink(missing_ok=True)
    finally:
        lock.release()


def _self() -> dict[str, object]:
    now = datetime.datetime.now().astimezone().isoformat(timespec="seconds")
    return {"process": os.getpid(), "host": socket.gethostname(), "since": now}


def _holder(folder: Path) -> str:
    """Who says that he holds the folder, in brackets."""
    try:
        told = json.loads((folder / HOLDER).read_text())
        return " (" + ", ".join(f"{name} {value}" for name, value in told.items()) + ")"
    except (OSError, ValueError, AttributeError):
        return ""
