"""The rows of a sweep on disk, in few Parquet files, each of which is written whole.

A sweep's tasks, in their order, are cut into partitions of a fixed number of tasks. While a
partition is open, the rows of each task are a small file in the folder ``000012/``. When all its
tasks are done these files are merged into ``000012.parquet``; as soon as that file exists, the
folder is ignored. So a process that is killed at any moment leaves each row behind exactly once.
"""

from __future__ import annotations

import contextlib
import itertools
import os
import shutil
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from ropeode.errors import RopeodeError
from ropeode.files import write_whole
from ropeode.sweep.design.columns import DIED, TIMED_OUT, Column, Row
from ropeode.sweep.storage.folder import write_errors

if TYPE_CHECKING:
    from ropeode.sweep.design.cases import Case, Task
    from ropeode.sweep.design.spec import SweepSpec

NUMBER = "case"
_ATTEMPTS = 5


class Store:
    """The rows in one folder.

    Arguments:
        folder: of the rows; it is created when the first are added.
        columns: of a row; its number in the sweep comes in addition.
        partition_size: tasks of a partition, the same each time that the folder is written to.
    """

    def __init__(self, folder: Path, columns: Mapping[str, Column], partition_size: int = 256):
        self.folder, self.partition_size = folder, partition_size
        types = {NUMBER: "int64", **{name: column.type for name, column in columns.items()}}
        self.schema = pa.schema([(name, pa.type_for_alias(kind)) for name, kind in types.items()])

    def clean(self) -> None:
        """Remove what a killed process may leave: parts of files, and folders already merged.

        Raises:
            RopeodeError: the operating system refuses.
        """
        with write_errors(self.folder):
            for part in self.folder.glob("**/.*.part"):
                part.unlink()
            for folder in self.folder.glob("*/"):
                if self._sealed(folder.name).exists():
                    shutil.rmtree(folder)

    def count(self) -> int:
        """The number of rows."""
        return sum(pq.read_metadata(path).num_rows for path in self.folder.glob("**/*.parquet"))

    def partition_of(self, task: Task) -> int:
        """The number of the partition that a task belongs to."""
        return task.number // self.partition_size

    def sealed(self, partition: int) -> bool:
        """Whether a partition is complete and merged."""
        return self._sealed(_name(partition)).exists()

    def keys(self, partition: int) -> set[str]:
        """The keys of the rows in an open partition."""
        return {
            key
            for part in files_of(self.folder, _name(partition))
            for key in read_file(part, ["key"]).column("key").to_pylist()
        }

    def table(self, cases: Sequence[Case], rows: Sequence[Row]) -> pa.Table:
        """Rows as a table, each with the number of its case."""
        numbered = [{NUMBER: c.number, **row} for c, row in zip(cases, rows, strict=True)]
        return pa.Table.from_pylist(numbered, schema=self.schema).sort_by(NUMBER)

    def renewed(self, cases: Sequence[Case], rows: pa.Table) -> pa.Table:
        """Rows of another sweep as rows of this one: the results stay, the inputs are rewritten."""
        inputs = pa.Table.from_pylist([{NUMBER: c.number, **c.inputs()} for c in cases])
        own = [
            (inputs if name in inputs.column_names else rows).column(name).cast(kind)
            for name, kind in zip(self.schema.names, self.schema.types, strict=True)
        ]
        return pa.Table.from_arrays(own, schema=self.schema)

    def add(self, partition: int, table: pa.Table) -> None:
        """Write rows of an open partition, all or none.

        Arguments:
            partition: its number.
            table: of new rows, in the store's schema.

        Raises:
            RopeodeError: the operating system refuses.
        """
        folder = self.folder / _name(partition)
        with write_errors(self.folder):
            folder.mkdir(parents=True, exist_ok=True)
            write_whole(folder / _file_name(table), _parquet(table))

    def seal(self, partition: int) -> None:
        """Merge the files of a partition that is complete.

        Raises:
            RopeodeError: the operating system refuses.
        """
        parts = files_of(self.folder, _name(partition))
        if not parts or self.sealed(partition):
            return
        table = pa.concat_tables(read_file(part) for part in parts).sort_by(NUMBER)
        numbers = table[NUMBER].to_numpy()
        if (numbers[1:] == numbers[:-1]).any():
            raise RopeodeError(f"{parts[0].parent}: a case has two rows; nothing was removed")
        with write_errors(self.folder):
            write_whole(self._sealed(_name(partition)), _parquet(table))
            _sync(self.folder)
            shutil.rmtree(parts[0].parent)

    def reopen(self, limit: float, died: bool) -> None:
        """Remove the rows of cases that may now have results; their partitions are open again.

        Arguments:
            limit: of now, in seconds. Cases whose limit was shorter are tried again.
            died: whether those are that killed their process.

        Raises:
            RopeodeError: the operating system refuses, or a file is damaged.
        """
        self.clean()
        for name in partitions(self.folder):
            for path in files_of(self.folder, name):
                # Two columns, since files are many and this is rare.
                few = read_file(path, ["status", "seconds"])
                status = few["status"].to_numpy()
                again = (status == TIMED_OUT) & (few["seconds"].to_numpy() < limit)
                again |= (status == DIED) & died
                if again.any():
                    with write_errors(self.folder):
                        self._keep(path, int(name), read_file(path).filter(pa.array(~again)))

    def _keep(self, path: Path, partition: int, rest: pa.Table) -> None:
        """Replace the rows of a file by some of them; if it is killed, by all or by these."""
        if path.parent == self.folder:
            # Counts as soon as the merged file has gone.
            if len(rest):
                self.add(partition, rest)
            path.unlink()
        elif len(rest):
            # Its name is that of its first case, whatever becomes of the others.
            moved = path.with_name(_file_name(rest))
            os.replace(path, moved)
            write_whole(moved, _parquet(rest))
        else:
            path.unlink()

    def _sealed(self, name: str) -> Path:
        return self.folder / f"{name}.parquet"


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


def read_parts(folder: Path, columns: Sequence[str] | None = None) -> Iterator[pa.Table]:
    """The rows of a folder, a partition at a time, each sorted by case.

    A run may be writing to the folder: each partition is read as it is at one moment.

    Arguments:
        folder: of the rows.
        columns: to read; all by default. The case's number is always read.

    Raises:
        RopeodeError: a file is damaged.
    """
    wanted = None if columns is None else list(dict.fromkeys([NUMBER, *columns]))
    for name in partitions(folder):
        for _ in range(_ATTEMPTS):
            with contextlib.suppress(FileNotFoundError):
                tables = [read_file(path, wanted) for path in files_of(folder, name)]
                break
        else:
            raise RopeodeError(f"{folder / name}: its files keep changing; try again")
        if tables:
            yield pa.concat_tables(tables).sort_by(NUMBER)


def partitions(folder: Path) -> list[str]:
    """The names of the partitions in a folder, sorted; none if there is no folder."""
    names = {path.name.partition(".")[0] for path in folder.glob("*")}
    return sorted(names - {""})


def files_of(folder: Path, partition: str) -> list[Path]:
    """The files with the rows of a partition."""
    sealed = folder / f"{partition}.parquet"
    return [sealed] if sealed.exists() else sorted((folder / partition).glob("*.parquet"))


def read_file(path: Path, columns: list[str] | None = None) -> pa.Table:
    """All of a file, or some columns of it.

    Raises:
        FileNotFoundError: it does not exist.
        RopeodeError: it is not a Parquet file, or damaged.
    """
    contents = path.read_bytes()
    try:
        # From memory, in one thread: the files are small, and many.
        return pq.read_table(pa.BufferReader(contents), columns=columns, use_threads=False)
    except (pa.ArrowException, OSError) as error:
        raise RopeodeError(
            f"{path}: damaged ({' '.join(str(error).split())}). Fix: remove it; the same command "
            "then computes its cases again"
        ) from error


def _file_name(table: pa.Table) -> str:
    return f"{table[NUMBER][0].as_py():012d}.parquet"


def _parquet(table: pa.Table) -> bytes:
    contents = pa.BufferOutputStream()
    pq.write_table(table, contents, compression="zstd")
    return contents.getvalue().to_pybytes()


def _sync(folder: Path) -> None:
    """Make sure that new names are on disk before old ones are removed."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _name(partition: int) -> str:
    return f"{partition:06d}"
