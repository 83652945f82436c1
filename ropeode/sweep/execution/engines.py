"""Where the tasks of a sweep are worked on: in this process, or in others of this machine.

An engine takes tasks and gives futures. Whose fault it is when a process dies is found out in
`ropeode.sweep.execution.dispatch`, for all engines alike.
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

Row = dict[str, Any]
Work = Callable[[Any], list[Row]]

# Tasks under way for each worker: one that it works on, and one that it will go on with.
AHEAD = 2
_START_S = 120.0
_STARTS = 3


class Engine(Protocol):
    """What works on tasks.

    Fields:
        lost: what a future raises when the process that worked on its task is gone.
    """

    lost: tuple[type[BaseException], ...]

    def slots(self) -> int:
        """How many tasks are to be under way."""
        ...

    def submit(self, task: Any) -> Future[list[Row]]:
        """Have a task worked on."""
        ...

    def check(self) -> None:
        """Raises:
        RopeodeError: nobody is left to do the work.
        """
        ...

    def close(self) -> None:
        """End what was started, at once."""
        ...


class InProcess:
    """Works on a task at once; a process that dies takes the sweep along."""

    lost: tuple[type[BaseException], ...] = ()

    def __init__(self, work: Work):
        self._work = work

    def slots(self) -> int:
        """One task at a time."""
        return 1

    def submit(self, task: Any) -> Future[list[Row]]:
        """Work on a task; the future is done."""
        future: Future[list[Row]] = Future()
        try:
            future.set_result(self._work(task))
        except Exception as error:
            future.set_exception(error)
        return future

    def check(self) -> None:
        """There is always this process."""

    def close(self) -> None:
        """There is nothing to end."""


class LocalProcesses:
    """Processes of this machine, each with a queue of its own, so that one may die alone.

    Arguments:
        work: what to do with a task; it can be pickled.
        workers: how many processes.

    Raises:
        RopeodeError: processes cannot be started.
    """

    lost: tuple[type[BaseException], ...] = (BrokenExecutor,)

    def __init__(self, work: Work, workers: int):
        self._work = work
        # Never by fork: a fork of a process in which JAX has started hangs.
        self._context = multiprocessing.get_context("spawn")
        self._workers = [_Worker(self._context) for _ in range(workers)]

    def slots(self) -> int:
        """A few more tasks than processes, so that none of them has to wait."""
        return AHEAD * len(self._workers)

    def submit(self, task: Any) -> Future[list[Row]]:
        """Give a task to the process that has fewest, or to a new one if that one is dead."""
        i = min(range(len(self._workers)), key=lambda i: self._workers[i].busy())
        try:
            return self._workers[i].submit(self._work, task)
        except BrokenExecutor:
            self._workers[i].close()
            self._workers[i] = _Worker(self._context)
            return self._workers[i].submit(self._work, task)

    def check(self) -> None:
        """A dead process makes its futures raise at once."""

    def close(self) -> None:
        """Kill the processes."""
        for worker in self._workers:
            worker.close()


class _Worker:
    """One process, which has been seen to start."""

    def __init__(self, context: SpawnContext):
        for _ in range(_STARTS):
            self._pool = ProcessPoolExecutor(1, mp_context=context, initializer=_begin)
            self._given: list[Future] = []
            with contextlib.suppress(BrokenExecutor):
                self._process = self._pool.submit(os.getpid).result(_START_S)
                return
            self._pool.shutdown()
        raise RopeodeError(
            "workers: a process of Python ends while it starts. Fix: in a script, call this below "
            "`if __name__ == '__main__':`"
        )

    def busy(self) -> int:
        self._given = [future for future in self._given if not future.done()]
        return len(self._given)

    def submit(self, work: Work, task: Any) -> Future[list[Row]]:
        future = self._pool.submit(_work, work, task)
        self._given.append(future)
        return future

    def close(self) -> None:
        # The pool would wait for the task that the process is at.
        if self.busy():
            with contextlib.suppress(ProcessLookupError):
                os.kill(self._process, signal.SIGKILL)
        self._pool.shutdown(cancel_futures=True)


def on_one_core(work: Work, task: Any) -> list[Row]:
    """Do the work of a worker, which has one processor: there is a worker for each."""
    from ropeode.threads import use_cores

    use_cores(1)
    return work(task)


def _begin() -> None:
    """Set up a worker: Ctrl-C is for its parent alone, with which it ends, however that ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    assert parent is not None

    def watch() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def _work(work: Work, task: Any) -> list[Row]:
    """Do the work, in a process that is all its own."""
    from ropeode.references.jax_setup import set_up_jax

    set_up_jax()
    return on_one_core(work, task)
