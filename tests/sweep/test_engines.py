"""Real processes and a real Dask cluster, whose workers are killed."""

from __future__ import annotations

import contextlib
import os
import random
import signal
import subprocess
import sys
import threading
import time
import warnings
from pathlib import Path

import pytest

from ropeode.errors import InputError, RopeodeError
from ropeode.sweep.design.columns import COLUMNS
from ropeode.sweep.execution import dask_cluster
from ropeode.sweep.execution.dask_cluster import DaskCluster
from ropeode.sweep.execution.engines import LocalProcesses
from ropeode.sweep.execution.task_queue import work_through
from ropeode.sweep.storage.row_files import Store
from tests.sweep.stand_in import Rows, Sweep, expected, stored

ROOT = Path(__file__).parents[2]
SWEEP = Sweep(count=120)


def statuses(rows):
    return {row["case"]: row["status"] for row in rows if row["status"] != "ok"}


def run(engine, folder, sweep=SWEEP):
    """The rows that an engine makes, each of which the store has."""
    done = []
    with contextlib.closing(engine):
        store = Store(folder, COLUMNS)
        work_through(sweep, store, engine, lambda done_now, total: done.append(done_now))
    assert done[0] == 0
    assert done[-1] == sweep.count
    assert done == sorted(done)
    return stored(folder)


@contextlib.contextmanager
def killing(processes, moments):
    """Kill one of the processes every now and then.

    Arguments:
        processes: gives the ids of those that may be killed.
        moments: seconds to wait before each.
    """
    killed, over = [], threading.Event()

    def kill():
        for moment in moments:
            if over.wait(moment):
                return
            if alive := processes():
                victim = random.Random(moment).choice(alive)
                with contextlib.suppress(ProcessLookupError):
                    os.kill(victim, signal.SIGKILL)
                    killed.append(victim)

    thread = threading.Thread(target=kill)
    thread.start()
    yield killed
    over.set()
    thread.join()


def test_local_processes_some_of_which_are_killed(tmp_path):
    engine = LocalProcesses(Rows(seconds=0.05), 2)
    with killing(lambda: [each._process for each in engine._workers], [0.2, 0.3, 0.5]) as killed:
        assert run(engine, tmp_path) == expected(SWEEP)
    assert killed


def test_a_case_that_kills_its_process_each_time_costs_no_other_case_its_row(tmp_path):
    sweep = Sweep(count=24)
    rows = run(LocalProcesses(Rows(deadly=frozenset({6})), 2), tmp_path, sweep)
    assert statuses(rows) == {6: "worker-died"}
    assert "died each time" in rows[6]["reason"]
    assert rows[:6] + rows[7:] == expected(sweep)[:6] + expected(sweep)[7:]


def test_processes_that_cannot_start_are_told_of(tmp_path):
    """As in a script that has no `if __name__ == "__main__"`."""
    (tmp_path / "script.py").write_text(
        "from ropeode.sweep.execution.engines import LocalProcesses\nLocalProcesses(print, 1)\n"
    )
    done = subprocess.run(
        [sys.executable, "script.py"], cwd=tmp_path, capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].startswith(
        "ropeode.errors.RopeodeError: workers: a process of Python ends while it starts"
    )


def alive(process):
    """Whether a process runs; one that has ended and that nobody has asked after does not."""
    with contextlib.suppress(FileNotFoundError):
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    return False


@pytest.mark.skipif(not Path("/proc").exists(), reason="looks at /proc")
def test_workers_end_with_the_process_that_started_them():
    """Also when it is killed, in the middle of a task."""
    code = (
        "from ropeode.sweep.execution.engines import LocalProcesses\n"
        "from tests.sweep.stand_in import Rows, Sweep\n"
        "if __name__ == '__main__':\n"
        "    engine = LocalProcesses(Rows(seconds=60), 2)\n"
        "    engine.submit(next(Sweep(4).tasks()))\n"
        "    print(*(each._process for each in engine._workers), flush=True)\n"
        "    input()\n"
    )
    pipe = subprocess.PIPE
    parent = subprocess.Popen([sys.executable, "-c", code], cwd=ROOT, stdin=pipe, stdout=pipe)
    assert parent.stdout is not None
    workers = [int(word) for word in parent.stdout.readline().split()]
    assert len(workers) == 2
    assert all(map(alive, workers))
    parent.kill()
    parent.communicate()
    end = time.monotonic() + 20
    while any(map(alive, workers)):
        assert time.monotonic() < end
        time.sleep(0.02)


@pytest.fixture(scope="module")
def cluster():
    """Two workers, each a process of its own; a task is given up after two have died with it."""
    distributed = pytest.importorskip("distributed")
    import dask

    quick = {
        "distributed.scheduler.allowed-failures": 1,
        "distributed.worker.multiprocessing-method": "spawn",
        "distributed.admin.tick.limit": "1h",
    }
    with (
        dask.config.set(quick),
        distributed.LocalCluster(
            n_workers=2,
            threads_per_worker=1,
            dashboard_address=":0",
            silence_logs=60,
            host="127.0.0.1",
        ) as made,
    ):
        yield made


def dask_workers(cluster):
    return [each.pid for each in cluster.workers.values() if each.pid]


def test_a_cluster_whose_workers_are_killed(cluster, tmp_path):
    engine = DaskCluster(Rows(seconds=0.05), cluster.scheduler_address)
    with killing(lambda: dask_workers(cluster), [0.3, 1.0, 1.0]) as killed:
        assert run(engine, tmp_path) == expected(SWEEP)
    assert killed


def test_a_case_that_kills_the_workers_of_a_cluster(cluster, tmp_path):
    sweep = Sweep(count=8, per_task=2)
    engine = DaskCluster(Rows(deadly=frozenset({3})), cluster.scheduler_address)
    rows = run(engine, tmp_path, sweep)
    assert statuses(rows) == {3: "worker-died"}
    assert rows[:3] + rows[4:] == expected(sweep)[:3] + expected(sweep)[4:]


def test_a_cluster_without_workers_is_waited_for_and_not_forever(tmp_path, monkeypatch):
    distributed = pytest.importorskip("distributed")
    monkeypatch.setattr(dask_cluster, "NO_WORKERS_S", 0.5)
    monkeypatch.setattr(dask_cluster, "_COUNT_EVERY_S", 0.1)
    with (
        distributed.LocalCluster(
            n_workers=0, processes=False, dashboard_address=":0", silence_logs=60
        ) as empty,
        contextlib.closing(DaskCluster(Rows(), empty.scheduler_address)) as engine,
        pytest.raises(RopeodeError, match="has had no workers .*finished cases are kept"),
    ):
        work_through(SWEEP, Store(tmp_path, COLUMNS), engine, lambda done, total: None)


def test_a_scheduler_that_does_not_answer(monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr(dask_cluster, "_CONNECT_S", 0.3)
    for address in ("tcp://127.0.0.1:1", "nonsense://", "127.0.0.1:99999"):
        with warnings.catch_warnings(), pytest.raises(InputError, match="^scheduler: .*answers"):
            DaskCluster(Rows(), address)
