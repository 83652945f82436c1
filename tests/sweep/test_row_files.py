"""Rows on disk: whole or not at all, once each, in few files, whenever a process is killed."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
from pathlib import Path
from unittest import mock
from unittest.mock import DEFAULT

import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ropeode.errors import RopeodeError
from ropeode.sweep import COLUMNS, Store, summarize
from tests.sweep.stand_in import Rows, Sweep, compute, expected, row, stored


def files(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def test_rows_come_back_as_they_were_and_in_few_files(tmp_path, monkeypatch):
    sweep = Sweep(count=47)
    compute(sweep, tmp_path)
    assert stored(tmp_path) == expected(sweep)
    assert sorted(files(tmp_path)) == ["000000.parquet", "000001.parquet", "000002.parquet"]
    # Anyone can read them, without ropeode.
    assert pq.read_table(tmp_path).sort_by("case").to_pylist() == expected(sweep)
    # To make the tasks of complete partitions again would take hours for a large sweep.
    (tmp_path / "000002.parquet").unlink()
    made, tasks = [], Sweep.tasks

    def counted(sweep, first=0):
        for task in tasks(sweep, first):
            made.append(task.number)
            yield task

    monkeypatch.setattr(Sweep, "tasks", counted)
    compute(sweep, tmp_path)
    assert made == [10, 11]
    assert stored(tmp_path) == expected(sweep)


class Killed(BaseException):
    """Nothing that runs after this can be seen on disk."""


@given(when=st.lists(st.integers(0, 45), max_size=6), skip=st.integers(0, 1))
@settings(deadline=None, max_examples=5)
def test_a_run_killed_at_any_write_goes_on_and_ends_with_the_same_files(
    tmp_path_factory, when, skip
):
    """Each change of the disk is a place to die: before it, or right after it."""
    sweep = Sweep(count=27)
    undisturbed = tmp_path_factory.mktemp("undisturbed")
    compute(sweep, undisturbed)
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
            for where, name in (
                *((os, name) for name in ("replace", "fsync", "rmdir", "unlink")),
                *((Path, name) for name in ("unlink", "mkdir")),
            ):
                real = getattr(where, name)
                stack.enter_context(mock.patch.object(where, name, dying(real, left)))
            with contextlib.suppress(Killed):
                compute(sweep, folder)
        there = [each["key"] for each in stored(folder)]
        assert len(there) == len(set(there)), "a row is there twice"
        assert before <= set(there), "a row that was there is gone"
    compute(sweep, folder)
    assert files(folder) == files(undisturbed)
    shutil.rmtree(folder)


def test_a_full_disk_ends_in_one_line_and_loses_nothing(tmp_path, room_for):
    """A limit on the size of files stands for the disk: no partition can be merged."""
    sweep, folder = Sweep(count=47), tmp_path / "full"
    compute(sweep, tmp_path / "free")
    merged = files(tmp_path / "free")
    with (
        room_for(len(merged["000000.parquet"]) - 1),
        pytest.raises(RopeodeError, match="cannot be written to .*finished cases are kept"),
    ):
        compute(sweep, folder)
    assert stored(folder) == expected(sweep)[:20]
    assert not [name for name in files(folder) if name.endswith(".part")]
    compute(sweep, folder)
    assert files(folder) == merged


def test_a_damaged_file_is_named(tmp_path):
    compute(Sweep(count=8), tmp_path)
    path = tmp_path / "000000.parquet"
    path.write_bytes(path.read_bytes()[:-20])
    with pytest.raises(RopeodeError, match="000000.parquet: damaged .* Fix: remove it"):
        stored(tmp_path)
    path.unlink()
    compute(Sweep(count=8), tmp_path)
    assert stored(tmp_path) == expected(Sweep(count=8))


def test_rows_of_many_files_are_summed_up(tmp_path):
    work = Rows(does={2: "raise", 46: "raise"})
    compute(Sweep(count=47), tmp_path / "rows-1", work)
    index = {"spec": {}, "software": {}, "count": 50, "columns": COLUMNS, "rows": "rows-1"}
    (tmp_path / "index.json").write_text(json.dumps({"format": 1, **index}))
    summary = summarize(tmp_path)
    assert (summary.done, summary.total) == (47, 50)
    assert dict(summary.statuses) == {"ok": 45, "failed": 2}
    own = summary.steppers["rk4"]
    assert own.ranges == {"error_max": (1 / 48, 1 / 3)}
    assert dict(own.counts["resolved"]) == {False: 16, True: 29}
    assert summary.reasons == {("failed", f"ArithmeticError: number {n}"): 1 for n in (2, 46)}


@pytest.mark.parametrize(("count", "again"), [(5, 2), (47, 4)])
def test_cases_with_a_shorter_limit_are_tried_again(tmp_path, monkeypatch, count, again):
    """In a merged partition, and in the files of an open one; and if that is killed midway.

    So are those that killed their process, where that is asked for.
    """
    late = {0: 2.0, 1: 2.0, 2: 2.0, 6: 9.0, 40: 2.0}
    unlucky = {n: {"status": "timed-out", "seconds": late[n]} for n in late}
    unlucky[3] = {"status": "worker-died", "seconds": None}

    def work(task):
        return [row(case) | unlucky.get(case.number, {}) for case in task.cases]

    folder, sweep = tmp_path / "rows", Sweep(count=count)
    store = Store(folder, COLUMNS, partition_size=5)
    if count == 5:
        # The second task is not done.
        task = next(sweep.tasks())
        store.add(0, store.table(task.cases[1:], work(task)[1:]))
    else:
        compute(sweep, folder, work)
    before = store.count()
    store.reopen(2.0, died=False)
    assert store.count() == before
    with monkeypatch.context() as patch:
        patch.setattr(Path, "unlink", mock.Mock(side_effect=KeyboardInterrupt))
        replaced = mock.Mock(side_effect=[DEFAULT, KeyboardInterrupt], wraps=os.replace)
        patch.setattr(os, "replace", replaced)
        with pytest.raises(KeyboardInterrupt):
            store.reopen(3.0, died=True)
    for limit, died, left in ((3.0, False, before - again), (0.0, True, before - again - 1)):
        store.reopen(limit, died=died)
        assert store.count() == left
    compute(sweep, folder)
    kept = [each["status"] for each in stored(folder)]
    assert kept == ["timed-out" if n == 6 else "ok" for n in range(count)]
