"""Real processes and a real Dask cluster, whose workers are killed."""

from __future__ import annotations

import contextlib
import subprocess
import sys
import time
import warnings
from pathlib import Path

import pytest

from ropeode.errors import InputError, RopeodeError
from ropeode.sweep import COLUMNS, DaskCluster, LocalProcesses, Store, work_through
from ropeode.threads import cores, use_cores
from tests.sweep.stand_in import Rows, Sweep, expected, stored

ROOT = Path(__file__).parents[2]
# Case 3 kills every process, and case 7, where a process may die once, the first that runs it.
SWEEP = Sweep(count=8, per_task=1)
ONCE, ALWAYS = frozenset({7}), frozenset({3})


def check(rows, status="worker-died", reason="died each time"):
    """Each case has its row, but for the one that kills its process each time, or hangs."""
    assert rows[:3] + rows[4:] == expected(SWEEP)[:3] + expected(SWEEP)[4:]
    assert (rows[3]["case"], rows[3]["status"]) == (3, status)
    assert reason in rows[3]["reason"]


def run(engine, folder):
    """The rows that an engine computes, as the store has them."""
    told = []
    with contextlib.closing(engine):
        work_through(SWEEP, Store(folder, COLUMNS), engine, lambda *each: told.append(each))
    assert told[0] == ("0 of 8 cases", 0.0)
    assert told[-1][0].startswith("8 of 8 cases, ")
    assert told[-1][0].endswith(" cases/s")
    assert [fraction for _, fraction in told] == [n / 8 for n in range(9)]
    return stored(folder)


def test_local_processes_of_which_one_dies(tmp_path):
    """Its case is computed again, when nothing else runs."""
    engine = LocalProcesses(Rows(deadly_once=ONCE, notes=tmp_path), 2)
    assert run(engine, tmp_path / "rows") == expected(SWEEP)
    assert (tmp_path / "7").exists()


@pytest.mark.slow
def test_a_case_that_hangs_is_killed(tmp_path):
    engine = LocalProcesses(Rows(slow=ALWAYS), 1, case_limit=0.3)
    check(rows := run(engine, tmp_path / "rows"), "timed-out", "longer than 0.3 s")
    assert rows[3]["seconds"] == 0.3


def test_rows_that_are_none_fail_their_case(tmp_path):
    """Whatever cases say in place of them; the others are computed."""
    said = (b"", b'{"rows": [{"key": [1]}]}', b"[1]")
    saying = dict(enumerate(said, start=2))
    rows = run(LocalProcesses(Rows(saying=saying), 1), tmp_path)
    for right, row in zip(expected(SWEEP), rows, strict=True):
        if row["case"] in saying:
            assert row["status"] == "failed"
            assert row["reason"] == "its process wrote something in place of its rows"
        else:
            assert row == right


def test_processes_that_cannot_start_are_reported(tmp_path):
    """As in a script with work of its own that has no `if __name__ == "__main__"`."""
    (tmp_path / "script.py").write_text(
        "from ropeode.sweep import LocalProcesses\ndef mine(task): pass\nLocalProcesses(mine, 1)\n"
    )
    done = subprocess.run(
        [sys.executable, "script.py"], cwd=tmp_path, capture_output=True, text=True, timeout=600
    )
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].startswith(
        "ropeode.errors.RopeodeError: workers: the Python process of a worker ended its process"
    )


def alive(process):
    """Whether a process runs; a zombie does not."""
    with contextlib.suppress(FileNotFoundError):
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    return False


@pytest.mark.skipif(not Path("/proc").exists(), reason="looks at /proc")
def test_workers_end_with_the_process_that_started_them():
    """Also when it is killed, in the middle of a task."""
    code = (
        "from ropeode.sweep import LocalProcesses\n"
        "from tests.sweep.stand_in import Rows, Sweep\n"
        "if __name__ == '__main__':\n"
        "    engine = LocalProcesses(Rows(seconds=60), 2)\n"
        "    engine.submit(next(Sweep(4).tasks()))\n"
        "    print(flush=True)\n"
        "    input()\n"
    )
    pipe = subprocess.PIPE
    parent = subprocess.Popen([sys.executable, "-c", code], cwd=ROOT, stdin=pipe, stdout=pipe)
    assert parent.stdout is not None
    parent.stdout.readline()
    children = Path(f"/proc/{parent.pid}/task/{parent.pid}/children")
    workers = [int(word) for word in children.read_text().split()]
    assert len(workers) >= 2
    assert all(map(alive, workers))
    parent.kill()
    parent.communicate()
    end = time.monotonic() + 600
    while any(map(alive, workers)):
        assert time.monotonic() < end
        time.sleep(0.02)


@contextlib.contextmanager
def cluster(workers, deaths=1, *, processes=True):
    """Workers; a task is given up after so many of them have died with it."""
    distributed = pytest.importorskip("distributed")
    import dask

    quick = {
        "distributed.scheduler.allowed-failures": deaths - 1,
        "distributed.worker.multiprocessing-method": "spawn",
        "distributed.admin.tick.limit": "1h",
    }
    where = {"host": "127.0.0.1"} if processes else {"processes": False}
    with (
        dask.config.set(quick),
        distributed.LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            dashboard_address=":0",
            silence_logs=60,
            **where,
        ) as running,
    ):
        yield running.scheduler_address


def test_a_cluster_with_a_case_that_raises(tmp_path):
    """Its worker is a thread of this process; others are processes."""
    try:
        with cluster(workers=1, processes=False) as address:
            rows = run(DaskCluster(Rows(raising=ALWAYS), address), tmp_path)
            assert cores() == 1
    finally:
        use_cores(None)
    check(rows, "failed", "ArithmeticError: number 3")


@pytest.mark.slow
@pytest.mark.parametrize("deaths", [1, 2])
def test_a_cluster_whose_workers_die(tmp_path, deaths):
    """Dask itself tries a task again if it allows for two deaths, and else it does not."""
    with cluster(workers=2, deaths=deaths) as address:
        work = Rows(deadly=ALWAYS, deadly_once=ONCE, notes=tmp_path)
        check(run(DaskCluster(work, address), tmp_path / "rows"))


@pytest.mark.slow
def test_a_case_that_hangs_on_a_cluster(tmp_path):
    with cluster(workers=1) as address:
        rows = run(DaskCluster(Rows(slow=ALWAYS), address, case_limit=0.5), tmp_path / "rows")
    check(rows, "timed-out", "longer than 0.5 s")


def test_a_cluster_without_workers_is_waited_for_and_not_forever(tmp_path):
    with (
        cluster(workers=0, processes=False) as address,
        contextlib.closing(DaskCluster(Rows(), address, no_workers_limit=0.2)) as engine,
        pytest.raises(RopeodeError, match="has had no workers .*finished cases are kept"),
    ):
        work_through(SWEEP, Store(tmp_path, COLUMNS), engine)


def test_a_scheduler_that_does_not_answer():
    pytest.importorskip("distributed")
    for address in ("tcp://127.0.0.1:1", "nonsense://"):
        with warnings.catch_warnings(), pytest.raises(InputError, match="^scheduler: .*answers"):
            DaskCluster(Rows(), address, connect_limit=0.2)
