"""Real processes and a real Dask cluster, whose workers are killed."""

from __future__ import annotations

import contextlib
import subprocess
import sys
import warnings
from pathlib import Path

import psutil
import pytest

from ropeode.errors import InputError, RopeodeError
from ropeode.sweep import COLUMNS, DaskCluster, LocalProcesses, Store, work_through
from ropeode.threads import cores, use_cores
from tests.sweep.stand_in import Rows, Sweep, expected, stored
from tests.time_limit import HANGS_AFTER_S

ROOT = Path(__file__).parents[2]
SWEEP = Sweep(count=8, per_task=1)
NO_ROWS = "its process wrote something in place of its rows"


def check(engine, folder, bad):
    """Each case has its row, whatever others do, and bad ones a status and a reason."""
    told = []
    with contextlib.closing(engine):
        work_through(SWEEP, Store(folder, COLUMNS), engine, lambda *each: told.append(each))
    assert told[0] == ("0 of 8 cases", 0.0)
    assert told[-1][0].startswith("8 of 8 cases, ")
    assert [fraction for _, fraction in told] == [n / 8 for n in range(9)]
    for right, row in zip(expected(SWEEP), stored(folder), strict=True):
        status, reason = bad.get(right["case"], ("ok", ""))
        if status == "ok":
            assert row == right
        assert (row["case"], row["status"]) == (right["case"], status)
        assert reason in (row["reason"] or "")
        if status == "timed-out":
            assert f"longer than {row['seconds']} s" in reason


def test_local_processes_of_which_one_dies_and_some_say_no_rows(tmp_path):
    """The case of the one is computed again, when nothing else runs."""
    does = {2: b"", 5: b'{"rows": [{"key": [1]}]}', 7: "die once"}
    engine = LocalProcesses(Rows(does=does, notes=tmp_path), 2)
    check(engine, tmp_path / "rows", dict.fromkeys((2, 5), ("failed", NO_ROWS)))
    assert (tmp_path / "7").exists()


@pytest.mark.slow
@pytest.mark.parametrize("deaths", [None, 1, 2])
def test_cases_that_hang_or_kill_their_process_have_rows_that_say_so(deaths, tmp_path):
    """Here, and on a cluster.

    Dask itself tries a task again if it allows for two deaths, and else it does not.
    """
    work = Rows(does={3: "hang", 5: "die", 7: "die once"}, notes=tmp_path)
    bad = {3: ("timed-out", "longer than 0.5 s"), 5: ("worker-died", "died each time")}
    if deaths is None:
        check(LocalProcesses(work, 1, case_limit=0.5), tmp_path / "rows", bad)
        return
    with cluster(workers=2, deaths=deaths) as address:
        check(DaskCluster(work, address, case_limit=0.5), tmp_path / "rows", bad)


@pytest.mark.slow
def test_processes_that_cannot_start_are_reported(tmp_path):
    """As in a script with work of its own that has no `if __name__ == "__main__"`."""
    code = "from ropeode.sweep import LocalProcesses\n"
    code += "def mine(task): pass\nLocalProcesses(mine, 1)\n"
    (tmp_path / "script.py").write_text(code)
    words = [sys.executable, "script.py"]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, timeout=HANGS_AFTER_S)
    assert done.returncode == 1
    assert b"workers: the Python process of a worker ended" in done.stderr.splitlines()[-1]


@pytest.mark.slow
def test_workers_end_with_the_process_that_started_them():
    """Also when it is killed, in the middle of a task."""
    code = (
        "from ropeode.sweep import LocalProcesses\n"
        "from tests.sweep.stand_in import Rows, Sweep\n"
        "if __name__ == '__main__':\n"
        "    LocalProcesses(Rows(seconds=60), 2).submit(next(Sweep(4).tasks()))\n"
        "    print(flush=True)\n"
        "    input()\n"
    )
    pipe = subprocess.PIPE
    parent = subprocess.Popen([sys.executable, "-c", code], cwd=ROOT, stdin=pipe, stdout=pipe)
    assert parent.stdout is not None
    parent.stdout.readline()
    workers = psutil.Process(parent.pid).children(recursive=True)
    assert len(workers) >= 2
    parent.kill()
    parent.communicate()
    assert not psutil.wait_procs(workers, timeout=HANGS_AFTER_S)[1]


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
    where |= {"n_workers": workers, "threads_per_worker": 1}
    with (
        dask.config.set(quick),
        distributed.LocalCluster(dashboard_address=":0", silence_logs=60, **where) as running,
    ):
        yield running.scheduler_address


def test_a_cluster_with_a_case_that_raises(tmp_path):
    """Its worker is a thread of this process; others are processes."""
    try:
        with cluster(workers=1, processes=False) as address:
            engine = DaskCluster(Rows(does={3: "raise"}), address)
            check(engine, tmp_path, {3: ("failed", "ArithmeticError: number 3")})
            assert cores() == 1
    finally:
        use_cores(None)


def test_a_cluster_without_workers_is_waited_for_and_not_forever(tmp_path):
    with (
        cluster(workers=0, processes=False) as address,
        contextlib.closing(DaskCluster(Rows(), address, no_workers_limit=0.2)) as engine,
        pytest.raises(RopeodeError, match="has had no workers .*finished cases are kept"),
    ):
        work_through(SWEEP, Store(tmp_path, COLUMNS), engine)


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "nonsense://"])
def test_a_scheduler_that_does_not_answer(address):
    pytest.importorskip("distributed")
    with warnings.catch_warnings(), pytest.raises(InputError, match="^scheduler: .*answers"):
        DaskCluster(Rows(), address, connect_limit=0.2)
