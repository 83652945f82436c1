"""Rows of one sweep that are rows of a larger one too."""

from __future__ import annotations

import functools
import itertools
from pathlib import Path

import numpy as np
import pyarrow as pa

from ropeode.sweep.design.cases import Case
from ropeode.sweep.design.spec import SweepSpec
from ropeode.sweep.storage.row_files import (
    NUMBER,
    PARTITION,
    Store,
    files_of,
    partitions,
    read_file,
)

_OPEN_FILES = 4
# Of a key, in hexadecimal digits, that rows are looked up by; the rest is compared then.
_DIGITS = 16


def take_over(old: Path, new: Path, sweep: SweepSpec) -> int:
    """Write the rows that a sweep shares with one before it.

    What a row says of its inputs is said anew: its number, and columns that the sweep before
    did not have.

    Arguments:
        old: folder of the rows that are there.
        new: folder of rows, to be made.
        sweep: whose cases are looked for.

    Returns:
        how many of the old rows are of no case of the sweep.
    """
    known = _Known(old)
    store = Store(new, sweep.columns)
    left = known.count
    tasks = enumerate(sweep.tasks())
    for partition, those in itertools.groupby(tasks, lambda each: each[0] // PARTITION):
        shared = known.rows([case for _, task in those for case in task.cases], store)
        if shared is not None:
            left -= shared.num_rows
            store.add(partition, shared)
    return left


class _Known:
    """The rows of a folder, found by their keys: 16 bytes of memory for each."""

    def __init__(self, folder: Path):
        self._files = [path for name in partitions(folder) for path in files_of(folder, name)]
        hashes, files, rows = [], [], []
        for at, path in enumerate(self._files):
            keys = read_file(path, ["key"]).column("key").to_pylist()
            hashes.append(_hashes(keys))
            files.append(np.full(len(keys), at, np.uint32))
            rows.append(np.arange(len(keys), dtype=np.uint32))
        every = np.concatenate([*hashes, np.empty(0, np.uint64)])
        order = np.argsort(every, kind="stable")
        self._hashes = every[order]
        self._file = np.concatenate([*files, np.empty(0, np.uint32)])[order]
        self._row = np.concatenate([*rows, np.empty(0, np.uint32)])[order]
        self._table = functools.lru_cache(_OPEN_FILES)(lambda at: read_file(self._files[at]))

    @property
    def count(self) -> int:
        return len(self._hashes)

    def rows(self, cases: list[Case], store: Store) -> pa.Table | None:
        """The rows of those of the cases that are known."""
        if not self.count:
            return None
        wanted = _hashes([case.key for case in cases])
        place = np.searchsorted(self._hashes, wanted).clip(max=self.count - 1)
        found = np.flatnonzero(self._hashes[place] == wanted)
        tables = []
        for at in np.unique(self._file[place[found]]):
            own = found[self._file[place[found]] == at]
            rows = self._table(int(at)).take(self._row[place[own]])
            same = [
                cases[i].key == key for i, key in zip(own, rows["key"].to_pylist(), strict=True)
            ]
            tables.append(store.renewed([cases[i] for i in own[same]], rows.filter(pa.array(same))))
        return pa.concat_tables(tables).sort_by(NUMBER) if tables else None


def _hashes(keys: list[str]) -> np.ndarray:
    return np.array([int(key[:_DIGITS], 16) for key in keys], np.uint64)
