"""Engines that compute the tasks of a sweep: this process, or others of this machine.

An engine takes tasks and returns futures. When a process dies, `ropeode.sweep.task_queue` finds the
case that is to blame, for all engines alike.
"""

from __future__ import annotations

import dataclasses
import json
import os
import queue
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, Protocol

from pydantic import TypeAdapter

from ropeode.errors import RopeodeError
from ropeode.sandbox import NO_LIMITS, Child, Ended, GuardLost, Limits, heard, say
from ropeode.sweep.design.columns import Row
from ropeode.validation import in_one_line

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


class WorkerDied(Exception):
    """The process that computed a task has ended."""


class WorkFailed(Exception):
    """Work raised in another process; the message is what, in one line."""


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

    lost = (WorkerDied,)

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
        self._work = work
        self._child: Child | None = None
        self._is_ready = False
        self.begin()

    def begin(self) -> Child:
        """Begin to start the process, if there is none."""
        if self._child is None:
            self._child = Child(_serve, self._work, limits=Limits(wall=_START_S))
        return self._child

    def start(self) -> Child:
        """Wait until the process has started, and imported what its work needs.

        Raises:
            RopeodeError: it cannot.
        """
        how = ""
        for _ in range(_STARTS):
            child = self.begin()
            if self._is_ready or isinstance(said := child.read(), bytes):
                self._is_ready = True
                return child
            how = said.how
            self.close()
        raise RopeodeError(
            f"workers: the Python process of a worker {how} while it starts. Fix: in a script, "
            "call this below `if __name__ == '__main__':`"
        )

    def run(self, task: Any, case_limit: float | None = None) -> list[Row]:
        """Compute a task, in a new process if the last one has died.

        Arguments:
            task: what to compute.
            case_limit: seconds that a case may take. The process of a task that takes longer is
                ended; if the task has several cases, that is after three minutes at least.

        Raises:
            WorkerDied: the process has died.
            WorkFailed: the work raised.
            TookTooLong: the process was ended.
            RopeodeError: no process can be started, or the sweep cannot go on.
        """
        seconds = case_limit
        if seconds is not None and len(task.cases) > 1:
            seconds = max(seconds, _MANY_CASES_S)
        try:
            child = self.start()
            child.limit(Limits(wall=seconds))
            child.send(task)
            said = child.read()
            child.limit(NO_LIMITS)
        except GuardLost:
            self.close()
            raise WorkerDied from None
        if isinstance(said, Ended):
            self.close()
            raise WorkerDied if case_limit is None or not said.limit else TookTooLong(case_limit)
        try:
            reply = _REPLY.validate_json(said, strict=True)
        except ValueError:
            self.close()
            raise WorkFailed("its process wrote something in place of its rows") from None
        if reply.rows is None:
            raise RopeodeError(reply.raised) if reply.stops else WorkFailed(reply.raised)
        return reply.rows

    def close(self) -> None:
        """End the process with all that it has started."""
        child, self._child, self._is_ready = self._child, None, False
        if child is not None:
            child.end()


@dataclasses.dataclass
class _Reply:
    """What a worker says of a task, in whose process any code may have written.

    Arguments:
        rows: of it; None where there are none.
        raised: what its work raised, in one line.
        stops: whether every case would raise it.
    """

    rows: list[dict[str, str | bool | int | float | None]] | None = None
    raised: str = ""
    stops: bool = False


_REPLY = TypeAdapter(_Reply)


def _serve(work: Work) -> bytes:
    """In the process of a worker: compute tasks, until nobody wants them any more."""
    # XLA reads this for the number of its threads. Several wait for one another on one processor,
    # which takes half as much time again.
    os.environ.setdefault("NPROC", "1")
    from ropeode.cache import set_up_jax

    set_up_jax()
    # It is ready.
    say(b"")
    for task in heard():
        try:
            reply = _Reply(on_one_core(work, task))
        except Exception as error:
            stops = isinstance(error, (OSError, RopeodeError))
            reply = _Reply(raised=str(error) if stops else in_one_line(error), stops=stops)
        # Numbers of NumPy are written as Python's.
        say(json.dumps(vars(reply), default=lambda number: number.item()).encode())
    return b""


def on_one_core(work: Work, task: Any) -> list[Row]:
    """Compute a task on one processor, since there is a worker for each."""
    from ropeode.threads import use_cores

    use_cores(1)
    return work(task)
