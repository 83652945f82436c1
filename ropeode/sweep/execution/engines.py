"""Engines that compute the tasks of a sweep: this process, or others of this machine.

An engine takes tasks and returns futures. When a process dies, `ropeode.sweep.task_queue` finds the
case that is to blame, for all engines alike.
"""

from __future__ import annotations

import concurrent.futures
import contextlib
import multiprocessing
import os
import queue
import signal
import threading
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from typing import Any, Protocol

from ropeode.errors import RopeodeError
from ropeode.sweep.design.columns import Row

# Computes the rows of a task, or of its first cases.
Work = Callable[[Any], list[Row]]

# Tasks under way for each worker: the current one and the next.
AHEAD = 2
_START_S = 120.0
_STARTS = 3
# Work hands back what it has well before, so that what takes longer is one case.
_MANY_CASES_S = 180.0


class TookTooLong(Exception):
    """A process was killed because its task took longer than the time limit of a case.

    Arguments:
        seconds: the limit.
    """

    def __init__(self, seconds: float):
        super().__init__(seconds)
        self.seconds = seconds


class Engine(Protocol):
    """An object that computes tasks.

    Attributes:
        lost: the exceptions of a future whose process has died.
    """

    lost: tuple[type[BaseException], ...] = ()

    def slots(self) -> int:
        """The number of tasks that should be under way."""
        ...

    def submit(self, task: Any) -> Future[list[Row]]:
        """Start a task."""
        ...

    def check(self) -> None:
        """See that there are workers, where that is not certain.

        Raises:
            RopeodeError: no worker is left.
        """

    def close(self) -> None:
        """End all processes that were started, at once."""


class InProcess(Engine):
    """Computes each task at once, in this process; a crash aborts the sweep.

    Arguments:
        work: computes a task.
    """

    def __init__(self, work: Work):
        self._work = work

    def slots(self) -> int:
        """One task at a time."""
        return 1

    def submit(self, task: Any) -> Future[list[Row]]:
        """Compute a task; the future is done."""
        future: Future[list[Row]] = Future()
        try:
            future.set_result(self._work(task))
        except Exception as error:
            future.set_exception(error)
        return future


class LocalProcesses(Engine):
    """Processes of this machine, each of which may die alone.

    Arguments:
        work: computes a task; it can be pickled.
        workers: number of processes.
        case_limit: seconds that a case may take; see `Worker.run`.

    Raises:
        RopeodeError: processes cannot be started.
    """

    lost = (BrokenExecutor,)

    def __init__(self, work: Work, workers: int, case_limit: float | None = None):
        self._work, self._case_limit = work, case_limit
        self._workers = [Worker(work) for _ in range(workers)]
        self._free: queue.SimpleQueue[Worker] = queue.SimpleQueue()
        for worker in self._workers:
            worker.start()
            self._free.put(worker)
        # Each waits for a process.
        self._threads = ThreadPoolExecutor(workers)

    def slots(self) -> int:
        """A few more tasks than processes, so that no process has to wait."""
        return AHEAD * len(self._workers)

    def submit(self, task: Any) -> Future[list[Row]]:
        """Send a task to the first process that is free."""
        return self._threads.submit(self._run, task)

    def _run(self, task: Any) -> list[Row]:
        worker = self._free.get()
        try:
            return worker.run(task, self._case_limit)
        finally:
            self._free.put(worker)

    def close(self) -> None:
        """Kill the processes."""
        self._threads.shutdown(wait=False, cancel_futures=True)
        for worker in self._workers:
            worker.close()


class Worker:
    """A process of this machine that computes one task at a time.

    Arguments:
        work: computes a task; it can be pickled.
    """

    def __init__(self, work: Work):
        self._work, self._process = work, 0
        self._pool: ProcessPoolExecutor | None = None
        self.begin()

    def begin(self) -> ProcessPoolExecutor:
        """Begin to start the process, if there is none."""
        if self._pool is None:
            # Never by fork: a fork of a process in which JAX has started hangs.
            context = multiprocessing.get_context("spawn")
            self._pool = ProcessPoolExecutor(1, mp_context=context, initializer=_begin)
            self._started = self._pool.submit(_set_up, self._work)
        return self._pool

    def start(self) -> ProcessPoolExecutor:
        """Wait until the process has started, and imported what its work needs.

        Raises:
            RopeodeError: it cannot.
        """
        for _ in range(_STARTS):
            pool = self.begin()
            with contextlib.suppress(BrokenExecutor):
                self._process = self._started.result(_START_S)
                return pool
            self.close()
        raise RopeodeError(
            "workers: the Python process of a worker ends while it starts. Fix: in a script, call "
            "this below `if __name__ == '__main__':`"
        )

    def run(self, task: Any, case_limit: float | None = None) -> list[Row]:
        """Compute a task, in a new process if the last one has died.

        Arguments:
            task: what to compute.
            case_limit: seconds that a case may take. The process of a task that takes longer is
                killed; if the task has several cases, that is after three minutes at least.

        Raises:
            BrokenExecutor: the process has died.
            TookTooLong: it was killed.
            RopeodeError: no process can be started.
        """
        seconds = case_limit
        if seconds is not None and len(task.cases) > 1:
            seconds = max(seconds, _MANY_CASES_S)
        pool = self.start()
        try:
            future = pool.submit(on_one_core, self._work, task)
            concurrent.futures.wait([future], seconds)
            if not future.done():
                assert case_limit is not None
                self.close()
                raise TookTooLong(case_limit)
            return future.result()
        except BrokenExecutor:
            self.close()
            raise

    def close(self) -> None:
        """Kill the process."""
        pool, self._pool = self._pool, None
        if pool is None:
            return
        # The pool would wait for the current task.
        if self._process:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self._process, signal.SIGKILL)
        pool.shutdown(cancel_futures=True)
        self._process = 0


def _set_up(work: Work) -> int:
    """Set JAX up in a process that does nothing else; the work is imported to hand it over."""
    from ropeode.cache import set_up_jax

    del work
    set_up_jax()
    return os.getpid()


def on_one_core(work: Work, task: Any) -> list[Row]:
    """Compute a task on one processor, since there is a worker for each."""
    from ropeode.threads import use_cores

    use_cores(1)
    return work(task)


def _begin() -> None:
    """Set up a worker: it ignores Ctrl-C, and ends with its parent, however that ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # XLA reads this for the number of its threads. Several wait for one another on one processor,
    # which takes half as much time again.
    os.environ.setdefault("NPROC", "1")
    parent = multiprocessing.parent_process()
    assert parent is not None

    def watch() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
