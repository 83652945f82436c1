"""Rows of a sweep that also belong to a larger one."""

from __future__ import annotations

import itertools
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc

from ropeode.sweep.design.spec import SweepSpec
from ropeode.sweep.storage.row_files import NUMBER, Store, files_of, partitions, read_file


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

    Raises:
        RopeodeError: a file is damaged, or the operating system refuses.
    """
    files = [path for name in partitions(old) for path in files_of(old, name)]
    keys = {path: read_file(path, ["key"])["key"] for path in files}
    left = sum(map(len, keys.values()))
    for partition, tasks in itertools.groupby(sweep.tasks(), store.partition_of):
        if not left:
            break
        cases = {case.key: case for task in tasks for case in task.cases}
        wanted = pa.array([*cases])
        having = [path for path in files if _are_in(keys[path], wanted).to_numpy().any()]
        if having:
            tables = map(read_file, having)
            shared = pa.concat_tables(each.filter(_are_in(each["key"], wanted)) for each in tables)
            own = [cases[key] for key in shared["key"].to_pylist()]
            store.add(partition, store.renewed(own, shared).sort_by(NUMBER))
            left -= len(shared)
    return left


def _are_in(keys: pa.ChunkedArray, wanted: pa.Array) -> pa.ChunkedArray:
    return pc.is_in(keys, wanted)  # pyright: ignore[reportAttributeAccessIssue]
