"""Tasks and their rows when processes die: by a script, in real processes, on a Dask cluster."""

from __future__ import annotations

import contextlib
import subprocess
import sys
import warnings
from collections import Counter
from concurrent.futures import Future
from pathlib import Path

import psutil
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ropeode.errors import InputError, RopeodeError
from ropeode.sweep import (
    COLUMNS,
    DaskCluster,
    LocalProcesses,
    Store,
    TookTooLong,
    dispatched,
    work_through,
)
from ropeode.threads import cores, use_cores
from tests.sweep.stand_in import Rows, Sweep, expected, row, stored
from tests.time_limit import HANGS_AFTER_S


class Gone(Exception):
    """What this engine's futures raise when a process has died."""


class Scripted:
    """An engine of one process per slot, in which what is under way together dies together.

    Arguments:
        slots: tasks under way.
        does: of cases, what they do: "die", with all that is under way with them, "raise" or
            "take too long".
        accidents: which submissions die for no reason of theirs.
        order: where in the list of those under way the next one to be done stands.
        most: rows that are handed back at a time.
    """

    lost = (Gone,)

    def __init__(self, slots=1, does=None, accidents=(), order=(0,), most=99):
        self._slots, self.does, self.accidents = slots, does or {}, accidents
        self.order, self.rows_at_once, self.tried = order, most, Counter()
        self.submitted, self.most, self.waiting = 0, 0, []

    def slots(self):
        self._advance()
        return self._slots

    def submit(self, task):
        future = Future()
        self.submitted += 1
        self.waiting.append((future, task, self.submitted in self.accidents))
        self.most = max(self.most, len(self.waiting))
        if len(self.waiting) >= self._slots:
            self._advance()
        return future

    def check(self):
        self._advance()

    def _advance(self):
        """Finish the next one, or all, if one of them kills."""
        if not self.waiting:
            return
        at = self.order[self.submitted % len(self.order)] % len(self.waiting)
        future, task, accident = self.waiting.pop(at)
        does = {self.does.get(case.number) for case in task.cases}
        if "die" in does or accident:
            for each in [future, *(other[0] for other in self.waiting)]:
                each.set_exception(Gone())
            self.waiting.clear()
        elif "take too long" in does:
            self.tried.update(case.number for case in task.cases if len(task.cases) == 1)
            future.set_exception(TookTooLong(2.5))
        elif "raise" in does:
            future.set_exception(ArithmeticError("nonsense"))
        else:
            future.set_result([row(case) for case in task.cases[: self.rows_at_once]])


def rows_of(sweep, engine):
    by_number = {}
    for task, rows in dispatched(sweep.tasks(), engine, check_every=0.001):
        for case, each in zip(task.cases, rows, strict=True):
            assert case.number not in by_number
            assert case.number // sweep.per_task == task.number
            by_number[case.number] = each
    return by_number


# What becomes of a case that does this, and a word of the reason.
BECOMES = {
    "die": ("worker-died", "died each time"),
    "raise": ("failed", "ArithmeticError: nonsense"),
    "take too long": ("timed-out", "longer than 2.5 s"),
}


@given(
    slots=st.integers(1, 5),
    does=st.dictionaries(st.integers(0, 39), st.sampled_from([*BECOMES]), max_size=9),
    accidents=st.sets(st.integers(1, 40), max_size=3),
    order=st.lists(st.integers(0, 4), min_size=1, max_size=5),
    most=st.integers(1, 9),
)
@settings(deadline=None, max_examples=60)
def test_every_case_has_one_row_and_only_the_culprits_a_bad_one(
    slots, does, accidents, order, most
):
    """Accidents that strike one case three times in a row would be no accidents."""
    accidents = accidents - {a for a in accidents if {a + 1, a + 2} & accidents}
    engine = Scripted(slots, does, accidents, order, most)
    rows = rows_of(Sweep(count=40, per_task=8), engine)
    assert set(rows) == set(range(40))
    for number, found in rows.items():
        status, reason = BECOMES.get(does.get(number), ("ok", ""))
        assert found["status"] == status
        assert reason in (found["reason"] or "")
        if status == "timed-out":
            assert (found["seconds"], engine.tried[number]) == (2.5, 2)
    assert engine.most <= slots


@pytest.mark.parametrize("does", ["nothing", "die"])
def test_no_more_tasks_are_made_than_there_is_room_for(does):
    """A hundred million tasks do not fit into memory, not even if all of them kill processes."""
    taken = []

    def tasks():
        for task in Sweep(count=80, per_task=1).tasks():
            taken.append(task.number)
            yield task

    engine = Scripted(3, dict.fromkeys(range(80), does))
    for done, _ in enumerate(dispatched(tasks(), engine, check_every=0.001)):
        assert len(taken) <= done + 1 + 3


@pytest.mark.parametrize("error", [OSError(28, "No space left"), InputError("out: full."), None])
def test_what_would_happen_to_every_case_ends_the_sweep(error):
    """Without an error the connection is lost."""

    class Ending(Scripted):
        def submit(self, task):
            future = Future()
            if error is not None:
                future.set_exception(error)
            elif future.cancel():
                future.set_running_or_notify_cancel()
            return future

    with pytest.raises(RopeodeError, match="finished cases are kept"):
        rows_of(Sweep(count=4), Ending())


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
    for right, found in zip(expected(SWEEP), stored(folder), strict=True):
        status, reason = bad.get(right["case"], ("ok", ""))
        if status == "ok":
            assert found == right
        assert (found["case"], found["status"]) == (right["case"], status)
        assert reason in (found["reason"] or "")
        if status == "timed-out":
            assert f"longer than {found['seconds']} s" in reason


@pytest.mark.slow
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
