"""Run a sweep into a folder, or resume it."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ropeode.errors import InputError
from ropeode.progress import Progress, silent
from ropeode.sweep.design.spec import SweepSpec, read_sweep
from ropeode.sweep.execution.dask_cluster import DaskCluster
from ropeode.sweep.execution.engines import Engine, InProcess, LocalProcesses, Work
from ropeode.sweep.execution.evaluate import evaluate
from ropeode.sweep.storage.folder import Index, locked, read_index, write_errors
from ropeode.validation import bad_value, check_whole, require

if TYPE_CHECKING:
    from ropeode.sweep.storage.summary import SweepSummary


def run_sweep(
    spec: SweepSpec | Mapping[str, Any] | str | Path,
    folder: str | Path,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    extend: bool = False,
    progress: Progress = silent,
) -> SweepSummary:
    """Run a sweep and store its rows in a folder; resume it if it was interrupted.

    The rows of each task are stored as soon as they are computed. They are the same, bit for bit,
    wherever they are computed.

    Arguments:
        spec: of the sweep, or its values, or a TOML file of them.
        folder: for this sweep only; it is created if it does not exist.
        workers: processes of this machine to run it in; None runs it in this process.
        scheduler: address of a Dask scheduler, as in ``tcp://host:8786``, to run it there.
        extend: whether a folder of another sweep may become this one's. All its rows must
            belong to cases of this sweep; they are not computed again.
        progress: called with the number of finished cases and their fraction, after each task.

    Raises:
        InputError: the spec or the folder cannot be used, the folder belongs to another sweep
            or is locked, an extra is not installed, or no scheduler answers.
        RopeodeError: the disk is full, or all workers have gone; finished cases are kept.
    """
    for package in ("pyarrow", "pandas", "filelock"):
        require(package, "data", "sweeps")
    from ropeode.sweep.storage.row_files import Store
    from ropeode.sweep.storage.summary import summarize
    from ropeode.sweep.task_queue import work_through

    sweep, path = _sweep(spec), Path(folder)
    _check_folder(path, sweep, extend)
    with contextlib.closing(_engine(path, workers, scheduler)) as engine:
        with write_errors(path):
            path.mkdir(exist_ok=True)
        with locked(path):
            with write_errors(path):
                index = _prepare_folder(path, sweep, extend)
            work_through(sweep, Store(path / index.rows, sweep.columns), engine, progress)
    return summarize(path)


def _sweep(spec: SweepSpec | Mapping[str, Any] | str | Path) -> SweepSpec:
    if isinstance(spec, SweepSpec):
        return spec
    return SweepSpec(spec) if isinstance(spec, Mapping) else read_sweep(Path(spec))


def _index(sweep: SweepSpec) -> Index:
    """The index of a folder in which this sweep is the first."""
    return Index(sweep.values, dict(sweep.software), sweep.count, sweep.columns)


def _check_folder(folder: Path, sweep: SweepSpec, extend: bool) -> Index | None:
    """The index in the folder, if there is one; nothing has been changed yet.

    Raises:
        InputError: the folder cannot be used for this sweep.
    """
    if not folder.parent.is_dir():
        fix = f"create {str(folder.parent)!r}"
        raise bad_value("folder", str(folder), "a folder in one that exists", fix)
    index = read_index(folder)
    if index and not extend and (changes := index.changes(_index(sweep))):
        fix = "choose another folder, or extend with --extend"
        raise InputError(_other_sweep(folder, changes, fix))
    return index


def _other_sweep(folder: Path, changes: list[str], fix: str) -> str:
    return (
        f"spec: not the spec of the rows in {folder} ({'; '.join(changes)}); allowed: the same "
        f"spec, with the same software. Fix: {fix}."
    )


def _prepare_folder(folder: Path, sweep: SweepSpec, extend: bool) -> Index:
    """The index of the folder, which from now on belongs to this sweep alone.

    Raises:
        InputError: the folder contains rows that do not belong to this sweep.
    """
    from ropeode.sweep.storage.extend import take_over

    old, index = _check_folder(folder, sweep, extend), _index(sweep)
    if old is None:
        index.write(folder)
        return index
    _remove_other_rows(folder, old)
    if not (changes := old.changes(index)):
        return old
    index = dataclasses.replace(index, rows=old.next_rows())
    if lost := take_over(folder / old.rows, folder / index.rows, sweep):
        shutil.rmtree(folder / index.rows, ignore_errors=True)
        changes = [f"{lost} of its rows do not belong to any case of this sweep", *changes]
        raise InputError(_other_sweep(folder, changes, "choose another folder"))
    index.write(folder)
    _remove_other_rows(folder, index)
    return index


def _remove_other_rows(folder: Path, index: Index) -> None:
    """Remove what an interrupted extension has left."""
    for rows in folder.glob("rows-*"):
        if rows.name != index.rows:
            shutil.rmtree(rows)


def _engine(folder: Path, workers: int | None, scheduler: str | None) -> Engine:
    work: Work = functools.partial(evaluate, folder=folder.resolve())
    if workers is not None and scheduler is not None:
        raise bad_value("workers", workers, "none with a scheduler", "leave out one of the two")
    if scheduler is not None:
        return DaskCluster(work, scheduler)
    if workers is None:
        return InProcess(work)
    return LocalProcesses(work, check_whole("workers", workers, at_least=1, example="2"))
