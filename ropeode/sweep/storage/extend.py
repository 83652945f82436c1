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
    partitions,
    read_file,
)

_OPEN_FILES = 4
# Rows are looked up by so many hexadecimal digits of their keys; then whole keys are compared.
_DIGITS = 16


def take_over(old: Path, store: Store, sweep: SweepSpec) -> int:
    """Copy the rows that a sweep shares with the one before it.

    The input columns of a copied row are rewritten: its number changes, and the sweep before
    may have had fewer parameters.

    Arguments:
        old: folder of the rows of the sweep before.
        store: to which the rows are copied.
        sweep: the larger one.

    Returns:
        The number of old rows that do not belong to any case of the sweep.
    """
    rows = _RowsByKey(old)
    lost = rows.count
    for partition, tasks in itertools.groupby(sweep.tasks(), store.partition_of):
        shared = rows.of([case for task in tasks for case in task.cases], store)
        if shared is not None:
            lost -= shared.num_rows
            store.add(partition, shared)
    return lost


class _RowsByKey:
    """The rows of a folder, looked up by their keys: 16 bytes of memory for each."""

    def __init__(self, folder: Path):
        files = [path for name in partitions(folder) for path in files_of(folder, name)]
        keys = [_hashes(read_file(path, ["key"])["key"].to_pylist()) for path in files]
        every = np.concatenate([*keys, np.empty(0, np.uint64)])
        self.count = len(every)
        # The place of each hash in order among all rows, and the first place of each file.
        self._order = np.argsort(every, kind="stable")
        self._hashes = every[self._order]
        self._starts = np.cumsum([0, *map(len, keys)])
        self._table = functools.lru_cache(_OPEN_FILES)(lambda at: read_file(files[at]))

    def of(self, cases: list[Case], store: Store) -> pa.Table | None:
        """The rows of those cases that have one."""
        if not self.count:
            return None
        wanted = _hashes([case.key for case in cases])
        at = np.searchsorted(self._hashes, wanted).clip(max=self.count - 1)
        hits = np.flatnonzero(self._hashes[at] == wanted)
        rows = self._order[at[hits]]
        files = np.searchsorted(self._starts, rows, side="right") - 1
        tables = []
        for file in np.unique(files):
            own = [cases[i] for i in hits[files == file]]
            table = self._table(int(file)).take(rows[files == file] - self._starts[file])
            same = [c.key == k for c, k in zip(own, table["key"].to_pylist(), strict=True)]
            own = [*itertools.compress(own, same)]
            tables.append(store.renewed(own, table.filter(pa.array(same))))
        return pa.concat_tables(tables).sort_by(NUMBER) if tables else None


def _hashes(keys: list[str]) -> np.ndarray:
    return np.array([int(key[:_DIGITS], 16) for key in keys], np.uint64)
