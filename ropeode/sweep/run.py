"""A sweep run into a folder, from where it was left."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ropeode.errors import InputError
from ropeode.sweep.design.content_hash import surroundings
from ropeode.sweep.design.spec import SweepSpec, read_sweep
from ropeode.sweep.execution.dask_cluster import DaskCluster
from ropeode.sweep.execution.engines import Engine, InProcess, LocalProcesses, Work
from ropeode.sweep.execution.evaluate import evaluate
from ropeode.sweep.storage.disk_errors import disk_named
from ropeode.sweep.storage.index import Index, read_index
from ropeode.sweep.storage.lock import locked
from ropeode.validation import check_whole, complaint, require

if TYPE_CHECKING:
    from ropeode.sweep.execution.task_queue import Progress
    from ropeode.sweep.storage.summary import SweepSummary


def run_sweep(
    spec: SweepSpec | Mapping[str, Any] | str | Path,
    folder: str | Path,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    extend: bool = False,
    progress: Progress = lambda done, total: None,
) -> SweepSummary:
    """Run a sweep, or what is left of it, and keep its rows in a folder.

    Each row is kept as soon as it is there. A sweep that was interrupted in any way goes on when
    it is run again. The rows are the same, bit for bit, wherever they are computed.

    Arguments:
        spec: of the sweep, or its values, or a TOML file of them.
        folder: the sweep's own; it is made where it is not there.
        workers: processes of this machine to run it in; None runs it in this process.
        scheduler: address of a Dask scheduler, as in ``tcp://host:8786``, to run it there.
        extend: whether a folder that holds another sweep may become this one's. All of its rows
            must be among the cases of this sweep; they are not computed again.
        progress: called after each task.

    Raises:
        InputError: the spec or the folder cannot be used, the folder holds another sweep or is
            in use, an extra is not installed, or no scheduler answers.
        RopeodeError: the disk is full, or all workers are gone; finished rows are kept.
    """
    for package in ("pyarrow", "pandas", "filelock"):
        require(package, "data", "sweeps")
    sweep = _spec(spec)
    path = _checked(Path(folder), sweep, extend)
    with contextlib.closing(_engine(path, workers, scheduler)) as engine:
        with disk_named(path):
            path.mkdir(exist_ok=True)
        with locked(path):
            _run(sweep, path, extend, engine, progress)
    from ropeode.sweep.storage.summary import summarize

    return summarize(path)


def _run(sweep: SweepSpec, folder: Path, extend: bool, engine: Engine, progress: Progress) -> None:
    from ropeode.sweep.execution.task_queue import work_through
    from ropeode.sweep.storage.row_files import Store

    with disk_named(folder):
        index = _prepared(folder, sweep, extend)
    work_through(sweep, Store(folder / index.rows, sweep.columns), engine, progress)


def _spec(given: SweepSpec | Mapping[str, Any] | str | Path) -> SweepSpec:
    if isinstance(given, SweepSpec):
        return given
    return SweepSpec(given) if isinstance(given, Mapping) else read_sweep(Path(given))


def _index(sweep: SweepSpec) -> Index:
    """The index of a folder that this sweep is the first in."""
    level = str(sweep.values.get("level", "consensus"))
    return Index(sweep.values, dict(surroundings(level)), sweep.count, sweep.columns)


def _checked(folder: Path, sweep: SweepSpec, extend: bool) -> Path:
    """The folder, of which nothing has been changed yet.

    Raises:
        InputError: it cannot be used for this sweep.
    """
    if not folder.parent.is_dir():
        fix = f"create {str(folder.parent)!r}"
        raise InputError(complaint("folder", str(folder), "a folder in one that exists", fix))
    there = read_index(folder)
    if there and not extend and (changes := there.changes(_index(sweep))):
        raise InputError(
            _changed(folder, changes, "choose another folder, or extend with --extend")
        )
    return folder


def _changed(folder: Path, changes: list[str], fix: str) -> str:
    return (
        f"spec: not that of the rows in {folder} ({'; '.join(changes)}); allowed: the same spec, "
        f"with the same software. Fix: {fix}."
    )


def _prepared(folder: Path, sweep: SweepSpec, extend: bool) -> Index:
    """The index of the folder, which is this sweep's from now on, and nothing else in it.

    Raises:
        InputError: the folder holds rows that are not of this sweep.
    """
    from ropeode.sweep.storage.extend import take_over

    _checked(folder, sweep, extend)
    there, index = read_index(folder), _index(sweep)
    if there is None:
        index.write(folder)
        return index
    _remove_other_rows(folder, there)
    if not (changes := there.changes(index)):
        return there
    index = dataclasses.replace(index, rows=there.next_rows())
    lost = take_over(folder / there.rows, folder / index.rows, sweep)
    if lost:
        shutil.rmtree(folder / index.rows, ignore_errors=True)
        words = [f"{lost} of its rows are of no case of this sweep", *changes]
        raise InputError(_changed(folder, words, "choose another folder"))
    index.write(folder)
    _remove_other_rows(folder, index)
    return index


def _remove_other_rows(folder: Path, index: Index) -> None:
    """What an extension has left that was interrupted."""
    for rows in folder.glob("rows-*"):
        if rows.name != index.rows:
            shutil.rmtree(rows)


def _engine(folder: Path, workers: int | None, scheduler: str | None) -> Engine:
    work: Work = functools.partial(evaluate, folder=folder.resolve())
    if workers is not None and scheduler is not None:
        raise InputError(
            complaint("workers", workers, "none with a scheduler", "leave out one of the two")
        )
    if scheduler is not None:
        return DaskCluster(work, scheduler)
    if workers is None:
        return InProcess(work)
    return LocalProcesses(work, check_whole("workers", workers, at_least=1, example="2"))
