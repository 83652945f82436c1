"""Rows of a sweep that also belong to a larger one."""

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
    Store,
    files_of,
    partition_of,
    partitions,
    read_file,
)

_OPEN_FILES = 4
# Rows are looked up by so many hexadecimal digits of their keys; then whole keys are compared.
_DIGITS = 16


def take_over(old: Path, new: Path, sweep: SweepSpec) -> int:
    """Copy the rows that a sweep shares with the one before it.

    The input columns of a copied row are rewritten: its number changes, and the sweep before
    may have had fewer parameters.

    Arguments:
        old: folder of the rows of the sweep before.
        new: folder of rows, which is created.
        sweep: the larger one.

    Returns:
        The number of old rows that do not belong to any case of the sweep.
    """
    rows, store = _RowsByKey(old), Store(new, sweep.columns)
    lost = rows.count
    for partition, tasks in itertools.groupby(sweep.tasks(), partition_of):
        shared = rows.of([case for task in tasks for case in task.cases], store)
        if shared is not None:
            lost -= shared.num_rows
            store.add(partition, shared)
    return lost


class _RowsByKey:
    """The rows of a folder, looked up by their keys: 16 bytes of memory for each."""

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

    def of(self, cases: list[Case], store: Store) -> pa.Table | None:
        """The rows of those cases that have one."""
        if not self.count:
            return None
        wanted = _hashes([case.key for case in cases])
        place = np.searchsorted(self._hashes, wanted).clip(max=self.count - 1)
        hits = np.flatnonzero(self._hashes[place] == wanted)
        tables = []
        for at in np.unique(self._file[place[hits]]):
            own = hits[self._file[place[hits]] == at]
            rows = self._table(int(at)).take(self._row[place[own]])
            same = [
                cases[i].key == key for i, key in zip(own, rows["key"].to_pylist(), strict=True)
            ]
            tables.append(store.renewed([cases[i] for i in own[same]], rows.filter(pa.array(same))))
        return pa.concat_tables(tables).sort_by(NUMBER) if tables else None


def _hashes(keys: list[str]) -> np.ndarray:
    return np.array([int(key[:_DIGITS], 16) for key in keys], np.uint64)
