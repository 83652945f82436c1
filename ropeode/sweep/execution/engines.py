"""Engines that compute the tasks of a sweep: this process, or others of this machine.

An engine takes tasks and returns futures. When a process dies, `ropeode.sweep.task_queue` finds the
case that is to blame, for all engines alike.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Future, ProcessPoolExecutor
from multiprocessing.context import SpawnContext
from typing import Any, Protocol

from ropeode.errors import RopeodeError
from ropeode.sweep.design.columns import Row

Work = Callable[[Any], list[Row]]

# Tasks under way for each worker: the current one and the next.
AHEAD = 2
_START_S = 120.0
_STARTS = 3


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
    """Processes of this machine, each with its own queue, so that one may die alone.

    Arguments:
        work: computes a task; it can be pickled.
        workers: number of processes.

    Raises:
        RopeodeError: processes cannot be started.
    """

    lost = (BrokenExecutor,)

    def __init__(self, work: Work, workers: int):
        self._work = work
        # Never by fork: a fork of a process in which JAX has started hangs.
        self._context = multiprocessing.get_context("spawn")
        self._workers = [_Worker(self._context) for _ in range(workers)]

    def slots(self) -> int:
        """A few more tasks than processes, so that no process has to wait."""
        return AHEAD * len(self._workers)

    def submit(self, task: Any) -> Future[list[Row]]:
        """Send a task to the process with the fewest, or to a new one if that one has died."""
        i = min(range(len(self._workers)), key=lambda i: self._workers[i].busy())
        try:
            return self._workers[i].submit(self._work, task)
        except BrokenExecutor:
            self._workers[i].close()
            self._workers[i] = _Worker(self._context)
            return self._workers[i].submit(self._work, task)

    def close(self) -> None:
        """Kill the processes."""
        for worker in self._workers:
            worker.close()


class _Worker:
    """One process, which has started."""

    def __init__(self, context: SpawnContext):
        for _ in range(_STARTS):
            self._pool = ProcessPoolExecutor(1, mp_context=context, initializer=_begin)
            self._tasks: list[Future] = []
            with contextlib.suppress(BrokenExecutor):
                self._process = self._pool.submit(os.getpid).result(_START_S)
                return
            self._pool.shutdown()
        raise RopeodeError(
            "workers: the Python process of a worker ends while it starts. Fix: in a script, call "
            "this below `if __name__ == '__main__':`"
        )

    def busy(self) -> int:
        self._tasks = [future for future in self._tasks if not future.done()]
        return len(self._tasks)

    def submit(self, work: Work, task: Any) -> Future[list[Row]]:
        future = self._pool.submit(_work, work, task)
        self._tasks.append(future)
        return future

    def close(self) -> None:
        # The pool would wait for the current task.
        if self.busy():
            with contextlib.suppress(ProcessLookupError):
                os.kill(self._process, signal.SIGKILL)
        self._pool.shutdown(cancel_futures=True)


def on_one_core(work: Work, task: Any) -> list[Row]:
    """Compute a task on one processor, since there is a worker for each."""
    from ropeode.threads import use_cores

    use_cores(1)
    return work(task)


def _begin() -> None:
    """Set up a worker: it ignores Ctrl-C, and ends with its parent, however that ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    assert parent is not None

    def watch() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def _work(work: Work, task: Any) -> list[Row]:
    """Compute a task in a process that does nothing else."""
    from ropeode.references.jax_setup import set_up_jax

    set_up_jax()
    return on_one_core(work, task)
