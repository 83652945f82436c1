"""Rows on disk: whole or not at all, once each, in few files, whenever a process is killed."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
from pathlib import Path
from unittest import mock

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
        yield from (made.append(task.number) or task for task in tasks(sweep, first))

    monkeypatch.setattr(Sweep, "tasks", counted)
    compute(sweep, tmp_path)
    assert made == [10, 11]
    assert stored(tmp_path) == expected(sweep)


class Killed(BaseException):
    """Nothing that runs after this can be seen on disk."""


def with_bad_rows(bad):
    """Computes tasks; some cases have a status instead of results."""
    return lambda task: [row(case) | bad.get(case.number, {}) for case in task.cases]


LATE, DEAD = {"status": "timed-out", "seconds": 2.0}, {"status": "worker-died", "seconds": None}
# In a merged partition; and in an open one, with some and with none to keep of a file.
BAD = {0: LATE, 3: DEAD, **dict.fromkeys((20, 24, 25, 26), LATE)}


@given(when=st.lists(st.integers(0, 60), max_size=6), skip=st.integers(0, 1))
@settings(deadline=None, max_examples=5)
def test_a_run_killed_at_any_write_goes_on_and_ends_with_the_same_files(
    tmp_path_factory, when, skip
):
    """Each change of the disk is a place to die: before it, or right after it.

    Also where cases without results are to be tried again.
    """
    sweep = Sweep(count=27)
    undisturbed = tmp_path_factory.mktemp("undisturbed")
    compute(sweep, undisturbed)
    folder = tmp_path_factory.mktemp("killed")
    store = Store(folder, COLUMNS, partition_size=5)
    for task in sweep.tasks():
        rows = with_bad_rows(BAD)(task)
        store.add(store.partition_of(task), store.table(task.cases, rows))
    store.seal(0)

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

    changes = [(os, name) for name in ("replace", "fsync", "rmdir", "unlink")]
    changes += [(Path, name) for name in ("unlink", "mkdir")]
    for moment in when:
        left = [moment]
        before = {each["key"] for each in stored(folder) if each["status"] == "ok"}
        with contextlib.ExitStack() as stack:
            for where, name in changes:
                real = getattr(where, name)
                stack.enter_context(mock.patch.object(where, name, dying(real, left)))
            with contextlib.suppress(Killed):
                store.reopen(3.0, died=True)
                compute(sweep, folder)
        there = [each["key"] for each in stored(folder)]
        assert len(there) == len(set(there)), "a row is there twice"
        assert before <= set(there), "a row that was there is gone"
    store.reopen(3.0, died=True)
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
    compute(Sweep(count=47), tmp_path / "rows-1", Rows(does={2: "raise", 46: "raise"}))
    index = {"spec": {}, "software": {}, "count": 50, "columns": COLUMNS, "rows": "rows-1"}
    (tmp_path / "index.json").write_text(json.dumps({"format": 1, **index}))
    summary = summarize(tmp_path)
    assert (summary.done, summary.total, summary.statuses) == (47, 50, {"ok": 45, "failed": 2})
    own = summary.steppers["rk4"]
    assert own.ranges == {"error_max": (1 / 48, 1 / 3)}
    assert own.counts["resolved"] == {False: 16, True: 29}
    assert summary.reasons == {("failed", f"ArithmeticError: number {n}"): 1 for n in (2, 46)}


def test_cases_with_a_shorter_limit_are_tried_again(tmp_path):
    """So are those that killed their process, where that is asked for."""
    bad = {0: LATE, 3: DEAD, 6: {**LATE, "seconds": 9.0}}
    store = Store(tmp_path, COLUMNS, partition_size=5)
    compute(Sweep(count=8), tmp_path, with_bad_rows(bad))
    for limit, died, left in ((2.0, False, 8), (3.0, False, 7), (0.0, True, 6)):
        store.reopen(limit, died=died)
        assert store.count() == left
    compute(Sweep(count=8), tmp_path)
    kept = [each["status"] for each in stored(tmp_path)]
    assert kept == ["timed-out" if n == 6 else "ok" for n in range(8)]
