"""A sweep's folder: its index, its lock, and the message when it cannot be written to."""

from __future__ import annotations

import contextlib
import dataclasses
import datetime
import json
import os
import socket
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from ropeode.errors import InputError, RopeodeError
from ropeode.files import read_text, write_whole
from ropeode.sweep.design.columns import COLUMNS, INPUTS, Column
from ropeode.validation import bad_value, shown

INDEX = "index.json"
LOCK = "lock"
HOLDER = "lock.json"
_FORMAT = 1


@dataclasses.dataclass(frozen=True)
class Index:
    """The contents of a folder, described in one small file.

    Arguments:
        spec: of the sweep, as JSON has it.
        software: that computes the rows.
        count: cases of the sweep.
        columns: of a row, by name.
        rows: name of the folder of the rows, inside the sweep's folder.
    """

    spec: Mapping[str, Any]
    software: Mapping[str, str]
    count: int
    columns: Mapping[str, Column]
    rows: str = "rows-1"

    @property
    def inputs(self) -> list[str]:
        """The columns of the inputs, without those that contain several others."""
        names = [name for name in self.columns if name in INPUTS or name not in COLUMNS]
        return [name for name in names if name not in ("key", "parameters")]

    def write(self, folder: Path) -> None:
        """Write it, in place of the one before."""
        values = {"format": _FORMAT, **dataclasses.asdict(self)}
        write_whole(folder / INDEX, json.dumps(values, indent=1) + "\n")

    def changes(self, other: Index) -> list[str]:
        """Differences to another index because of which results may differ, in words."""
        return [
            *_differences(self.spec, other.spec),
            *_differences(self.software, other.software, "software"),
        ]

    def next_rows(self) -> str:
        """A name for the folder of the rows that will replace these."""
        return f"rows-{int(self.rows.removeprefix('rows-')) + 1}"


def read_index(folder: Path) -> Index | None:
    """The index of a folder; None if the folder is new or empty.

    Raises:
        InputError: there is something else in the folder, or the index cannot be read.
    """
    path = folder / INDEX
    if folder.exists() and not folder.is_dir():
        raise bad_value("folder", str(folder), "a folder", "choose another name")
    if not path.exists():
        # A run that was killed early may have left its lock.
        if folder.exists() and any(each.name not in (LOCK, HOLDER) for each in folder.iterdir()):
            allowed = "a sweep's folder, an empty one, or a new one"
            raise bad_value("folder", str(folder), allowed, "choose another folder")
        return None
    try:
        values = json.loads(read_text("folder", path))
        if values.pop("format") != _FORMAT:
            raise ValueError("written by another version of ropeode")
        columns = {name: Column(*column) for name, column in values.pop("columns").items()}
        return Index(columns=columns, **values)
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        allowed = f"a sweep's folder ({error})"
        raise bad_value("folder", str(folder), allowed, "choose another folder") from error


def _differences(old: Any, new: Any, name: str = "") -> Iterator[str]:
    """The differences between two plain values; each begins with the name of what differs."""
    if isinstance(old, Mapping) and isinstance(new, Mapping):
        for key in {**old, **new}:
            yield from _differences(old.get(key), new.get(key), f"{name}.{key}".removeprefix("."))
    elif isinstance(old, list) and isinstance(new, list):
        added = [value for value in new if value not in old]
        removed = [value for value in old if value not in new]
        if added:
            yield f"{name}: {shown(added)} added"
        if removed:
            yield f"{name}: {shown(removed)} removed"
        if old != new and not added and not removed:
            yield f"{name}: in another order"
    elif old != new:
        yield f"{name}: was {shown(old)}, now {shown(new)}"


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Lock a folder for this process.

    The operating system releases the lock when the process ends, however it ends. So a lock is
    never left behind, whatever the note beside it says.

    Arguments:
        folder: that exists.

    Raises:
        InputError: another process holds the lock; the message says which.
    """
    import filelock

    # Another thread than the one that locks may unlock.
    lock = filelock.FileLock(folder / LOCK, thread_local=False)
    try:
        lock.acquire(blocking=False)
    except filelock.Timeout:
        allowed = f"a folder that no other run is writing to{_holder(folder)}"
        fix = "wait for it, or choose another folder"
        raise bad_value("folder", str(folder), allowed, fix) from None
    try:
        now = datetime.datetime.now().astimezone().isoformat(timespec="seconds")
        note = {"process": os.getpid(), "host": socket.gethostname(), "since": now}
        write_whole(folder / HOLDER, json.dumps(note))
        yield
        (folder / HOLDER).unlink(missing_ok=True)
    finally:
        lock.release()


def _holder(folder: Path) -> str:
    """The process that holds the lock, as its note says, in brackets."""
    try:
        note = json.loads((folder / HOLDER).read_text())
        return " (" + ", ".join(f"{name} {value}" for name, value in note.items()) + ")"
    except (OSError, ValueError, AttributeError):
        return ""


@contextlib.contextmanager
def write_errors(folder: Path) -> Iterator[None]:
    """Report in one line that the operating system refuses to write to a folder.

    Raises:
        RopeodeError: it refuses.
    """
    try:
        yield
    except (OSError, InputError) as error:
        cause = error if isinstance(error, OSError) else error.__cause__
        if not isinstance(cause, OSError):
            raise
        raise RopeodeError(
            f"folder: {folder} cannot be written to ({cause.strerror or cause}); finished cases "
            "are kept. Fix: free some space, then run the same command again"
        ) from error
