"""Run a sweep into a folder, or resume it."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import math
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ropeode.errors import InputError
from ropeode.progress import Progress, bar, shows_progress
from ropeode.sweep.storage.folder import Index, locked, read_index, write_errors
from ropeode.validation import bad_value, check_positive, check_whole, require

# Below, so that a missing extra is told.
if TYPE_CHECKING:
    from ropeode.sweep.design.spec import SweepSpec
    from ropeode.sweep.execution.engines import Engine, Work
    from ropeode.sweep.storage.summary import SweepSummary


@shows_progress
def run_sweep(
    spec: SweepSpec | Mapping[str, Any] | str | Path,
    folder: str | Path,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    extend: bool = False,
    case_limit: float | None = None,
    progress: Progress = bar,
) -> SweepSummary:
    """Run a sweep and store its rows in a folder; resume it if it was interrupted.

    Rows are stored every minute or so, and after each task. But for the column `seconds`
    they are the same, bit for bit, wherever they are computed.

    Arguments:
        spec: of the sweep, or its values, or a TOML file of them.
        folder: for this sweep only; it is created if it does not exist.
        workers: processes of this machine to run it in; None runs it in this process.
        scheduler: address of a Dask scheduler, as in ``tcp://host:8786``, to run it there.
        extend: whether a folder of another sweep may become this one's. All its rows must
            belong to cases of this sweep; they are not computed again.
        case_limit: seconds that a case may take, with its reference and with what is compiled
            for it. Its process is killed, also without `workers`, and its row says `timed-out`.
            Cases whose limit was shorter are tried again. So are those that killed their process,
            where cases run in processes of their own.
        progress: called with the number of finished cases and their fraction, after each task.

    Raises:
        InputError: the spec or the folder cannot be used, the folder belongs to another sweep
            or is locked, an extra is not installed, or no scheduler answers.
        RopeodeError: the disk is full, or all workers have gone; finished cases are kept.

    Examples:
        >>> from ropeode import run_sweep
        >>> grid = {"damping": [0.0, 0.1], "num_nodes": [4], "frames": [3]}
        >>> run_sweep({"steppers": ["rk4"], "grid": grid}, "ropes")
        <SweepSummary: ropes: 6 of 6 cases>
    """
    for package in ("filelock", "pyarrow", "pandas"):
        require(package, "data", "sweeps")
    from ropeode.sweep.storage.row_files import Store
    from ropeode.sweep.storage.summary import summarize
    from ropeode.sweep.task_queue import work_through

    sweep, path = _sweep(spec), Path(folder)
    if case_limit is not None:
        case_limit = check_positive("case_limit", case_limit, example="600")
    _check_folder(path, sweep, extend)
    with contextlib.closing(_engine(path, workers, scheduler, case_limit)) as engine:
        with write_errors(path):
            path.mkdir(exist_ok=True)
        with locked(path):
            with write_errors(path):
                index = _prepare_folder(path, sweep, extend)
            store = Store(path / index.rows, sweep.columns)
            # In this process a case that kills it again would end the sweep.
            store.reopen(math.inf if case_limit is None else case_limit, died=bool(engine.lost))
            work_through(sweep, store, engine, progress)
    return summarize(path)


def _sweep(spec: SweepSpec | Mapping[str, Any] | str | Path) -> SweepSpec:
    from ropeode.sweep.design.spec import SweepSpec, read_sweep

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
    from ropeode.sweep.storage.row_files import Store, take_over

    old, index = _check_folder(folder, sweep, extend), _index(sweep)
    if old is None:
        index.write(folder)
        return index
    _remove_other_rows(folder, old)
    if not (changes := old.changes(index)):
        return old
    index = dataclasses.replace(index, rows=old.next_rows())
    if lost := take_over(folder / old.rows, Store(folder / index.rows, sweep.columns), sweep):
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


def _engine(
    folder: Path, workers: int | None, scheduler: str | None, case_limit: float | None
) -> Engine:
    from ropeode.sweep.execution.engines import InProcess, LocalProcesses
    from ropeode.sweep.execution.evaluate import evaluate

    work: Work = functools.partial(evaluate, folder=folder.resolve())
    if workers is not None and scheduler is not None:
        raise bad_value("workers", workers, "none with a scheduler", "leave out one of the two")
    if scheduler is not None:
        from ropeode.sweep.execution.dask_cluster import DaskCluster

        return DaskCluster(work, scheduler, case_limit)
    if workers is None and case_limit is None:
        return InProcess(work)
    count = 1 if workers is None else check_whole("workers", workers, at_least=1, example="2")
    return LocalProcesses(work, count, case_limit)
