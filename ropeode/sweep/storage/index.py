"""What a sweep's folder says of itself, in one small file."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from ropeode.errors import InputError
from ropeode.files import read_text, write_whole
from ropeode.sweep.design.columns import Column
from ropeode.sweep.storage.lock import HOLDER, LOCK
from ropeode.validation import complaint, shown

INDEX = "index.json"
_FORMAT = 1
# What a run that was killed early may have left.
_OWN = {LOCK, HOLDER}


@dataclasses.dataclass(frozen=True)
class Index:
    """What is in a folder.

    Arguments:
        spec: what is asked for, as JSON has it.
        software: what else determines the results.
        count: cases of the sweep.
        columns: of a row, by name.
        rows: name of the folder of the rows, inside the sweep's folder.
    """

    spec: Mapping[str, Any]
    software: Mapping[str, str]
    count: int
    columns: Mapping[str, Column]
    rows: str = "rows-1"

    def write(self, folder: Path) -> None:
        """Put it in the place of the one that is there."""
        values = {"format": _FORMAT, **dataclasses.asdict(self)}
        write_whole(folder / INDEX, json.dumps(values, indent=1) + "\n")

    def changes(self, other: Index) -> list[str]:
        """How the results of another one may differ, in words."""
        return [
            *_differences(self.spec, other.spec),
            *_differences(self.software, other.software, "software"),
        ]

    def next_rows(self) -> str:
        """A name for the folder of the rows that are to replace these."""
        return f"rows-{int(self.rows.removeprefix('rows-')) + 1}"


def read_index(folder: Path) -> Index | None:
    """The index of a folder; None where nothing has ever been there.

    Raises:
        InputError: there is something else in the folder, or the index cannot be read.
    """
    path = folder / INDEX
    if folder.exists() and not folder.is_dir():
        raise InputError(complaint("folder", str(folder), "a folder", "choose another name"))
    if not path.exists():
        if folder.exists() and any(each.name not in _OWN for each in folder.iterdir()):
            raise InputError(
                complaint(
                    "folder",
                    str(folder),
                    "a sweep's folder, an empty one, or a new one",
                    "choose another folder",
                )
            )
        return None
    try:
        values = json.loads(read_text("folder", path))
        if values.pop("format") != _FORMAT:
            raise ValueError("made by another version of ropeode")
        columns = {name: Column(*column) for name, column in values.pop("columns").items()}
        return Index(columns=columns, **values)
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(
            complaint("folder", str(folder), f"a sweep's folder ({error})", "choose another folder")
        ) from error


def _differences(old: Any, new: Any, name: str = "") -> Iterator[str]:
    """What differs between two plain values, in words that begin with a name."""
    if isinstance(old, Mapping) and isinstance(new, Mapping):
        for key in {**old, **new}:
            yield from _differences(old.get(key), new.get(key), f"{name}.{key}".removeprefix("."))
    elif isinstance(old, list) and isinstance(new, list):
        added = [value for value in new if value not in old]
        gone = [value for value in old if value not in new]
        if added:
            yield f"{name}: {shown(added)} added"
        if gone:
            yield f"{name}: {shown(gone)} gone"
        if old != new and not added and not gone:
            yield f"{name}: in another order"
    elif old != new:
        yield f"{name}: was {shown(old)}, now {shown(new)}"
