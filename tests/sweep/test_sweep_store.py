"""Rows on disk: whole or not at all, once each, in few files, whatever is killed when."""

from __future__ import annotations

import contextlib
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from unittest import mock

import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ropeode.errors import RopeodeError
from ropeode.sweep.design.columns import COLUMNS
from ropeode.sweep.execution import task_queue
from ropeode.sweep.execution.engines import InProcess
from ropeode.sweep.execution.task_queue import work_through
from ropeode.sweep.storage import row_files
from ropeode.sweep.storage.row_files import Store
from tests.sweep.stand_in import Rows, Sweep, expected, stored

ROOT = Path(__file__).parents[2]


def quiet(done: int, total: int) -> None:
    """Progress that nobody watches."""


def files(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


@pytest.fixture(autouse=True)
def small_partitions(monkeypatch):
    """Partitions of five tasks, so that few cases have many."""
    monkeypatch.setattr(row_files, "PARTITION", 5)
    monkeypatch.setattr(task_queue, "PARTITION", 5)


def test_rows_come_back_as_they_were_and_in_few_files(tmp_path):
    sweep = Sweep(count=47)
    work_through(sweep, Store(tmp_path, COLUMNS), InProcess(Rows()), quiet)
    assert stored(tmp_path) == expected(sweep)
    assert sorted(files(tmp_path)) == ["000000.parquet", "000001.parquet", "000002.parquet"]
    # Anyone can read them, without ropeode.
    assert pq.read_table(tmp_path).sort_by("case").to_pylist() == expected(sweep)


class Killed(BaseException):
    """Nothing that runs after this can be seen on disk."""


@given(when=st.lists(st.integers(0, 45), max_size=6), skip=st.integers(0, 1))
@settings(deadline=None, max_examples=12)
def test_a_run_killed_at_any_write_goes_on_and_ends_with_the_same_files(
    tmp_path_factory, when, skip
):
    """Each change of the disk is a place to die: before it, or right after it."""
    sweep = Sweep(count=27)
    undisturbed = tmp_path_factory.mktemp("undisturbed")
    work_through(sweep, Store(undisturbed, COLUMNS), InProcess(Rows()), quiet)
    folder = tmp_path_factory.mktemp("killed")

    def dying(real, left):
        def call(*args, **named):
            left[0] -= 1
            if left[0] < 0:
                raise Killed
            result = real(*args, **named)
            if left[0] == 0 and skip:
                raise Killed
            return result

        return call

    for moment in when:
        left = [moment]
        before = {each["key"] for each in stored(folder)}
        with contextlib.ExitStack() as stack:
            for where, name in [
                (os, "replace"),
                (os, "fsync"),
                (os, "rmdir"),
                (os, "unlink"),
                (Path, "unlink"),
                (Path, "mkdir"),
            ]:
                real = getattr(where, name)
                stack.enter_context(mock.patch.object(where, name, dying(real, left)))
            with contextlib.suppress(Killed):
                work_through(sweep, Store(folder, COLUMNS), InProcess(Rows()), quiet)
        there = [each["key"] for each in stored(folder)]
        assert len(there) == len(set(there)), "a row is there twice"
        assert before <= set(there), "a row that was there is gone"
    work_through(sweep, Store(folder, COLUMNS), InProcess(Rows()), quiet)
    assert files(folder) == files(undisturbed)
    shutil.rmtree(folder)


def start(folder: Path, count: int, seconds: float) -> subprocess.Popen:
    code = (
        "from pathlib import Path\nfrom tests.sweep.stand_in import run\n"
        f"run(Path({str(folder)!r}), {count}, {seconds})"
    )
    return subprocess.Popen([sys.executable, "-c", code], cwd=ROOT, stderr=subprocess.PIPE)


def test_processes_killed_at_many_moments_lose_no_row(tmp_path):
    """With SIGKILL, each a little later than the one before."""
    sweep, folder = Sweep(count=400), tmp_path / "killed"
    seen: set[str] = set()
    killed = 0
    for moment in range(12):
        process = start(folder, sweep.count, 0.005)
        while not list(folder.rglob("*.parquet")) and process.poll() is None:
            time.sleep(0.001)
        time.sleep(0.013 * moment)
        process.send_signal(signal.SIGKILL)
        process.communicate()
        killed += process.returncode == -signal.SIGKILL
        there = [each["key"] for each in stored(folder)]
        assert len(there) == len(set(there))
        assert seen <= set(there)
        seen = set(there)
    assert killed >= 6
    process = start(folder, sweep.count, 0.0)
    assert process.communicate() == (None, b"")
    assert stored(folder) == expected(sweep)
    assert not [name for name in files(folder) if name.endswith(".part")]


def test_a_full_disk_ends_in_one_line_and_loses_nothing(tmp_path):
    """A limit on the size of files stands for the disk: no partition can be merged."""
    sweep, folder = Sweep(count=47), tmp_path / "full"
    work_through(sweep, Store(tmp_path / "free", COLUMNS), InProcess(Rows()), quiet)
    merged = files(tmp_path / "free")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    limit = len(merged["000000.parquet"]) - 1
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, before[1]))
        with pytest.raises(RopeodeError, match="cannot be written to .*finished cases are kept"):
            work_through(sweep, Store(folder, COLUMNS), InProcess(Rows()), quiet)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert stored(folder) == expected(sweep)[:20]
    assert not [name for name in files(folder) if name.endswith(".part")]
    work_through(sweep, Store(folder, COLUMNS), InProcess(Rows()), quiet)
    assert files(folder) == merged


def test_a_damaged_file_is_named(tmp_path):
    work_through(Sweep(count=8), Store(tmp_path, COLUMNS), InProcess(Rows()), quiet)
    path = tmp_path / "000000.parquet"
    path.write_bytes(path.read_bytes()[:-20])
    with pytest.raises(RopeodeError, match="000000.parquet: damaged .* Fix: remove it"):
        stored(tmp_path)
    path.unlink()
    work_through(Sweep(count=8), Store(tmp_path, COLUMNS), InProcess(Rows()), quiet)
    assert stored(tmp_path) == expected(Sweep(count=8))
