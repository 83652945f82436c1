"""An engine that computes the tasks of a sweep on a running Dask cluster."""

from __future__ import annotations

import functools
import threading
import time
from concurrent.futures import Future
from typing import Any

from ropeode.errors import RopeodeError
from ropeode.sweep.design.columns import Row
from ropeode.sweep.execution.engines import AHEAD, Engine, Work, Worker, WorkerDied, on_one_core
from ropeode.validation import bad_value, require

_COUNT_EVERY_S = 1.0


class DaskCluster(Engine):
    """The workers of a Dask scheduler. Dask itself retries the tasks of a worker that died.

    Arguments:
        work: computes a task; the workers can import it.
        address: of the scheduler, as in ``tcp://host:8786``.
        case_limit: seconds that a case may take. With one, each thread of the cluster's workers
            starts a process that can be killed.
        connect_limit: seconds in which the scheduler must answer.
        no_workers_limit: seconds for which it may be without workers. A cluster that starts
            workers on demand needs time for the first one.

    Raises:
        InputError: no scheduler answers there, or the extra `dask` is not installed.
    """

    def __init__(
        self,
        work: Work,
        address: str,
        case_limit: float | None = None,
        *,
        connect_limit: float = 10.0,
        no_workers_limit: float = 300.0,
    ):
        require("distributed", "dask", "Dask clusters")
        import distributed

        # A process that a worker starts may die too.
        self.lost = (distributed.KilledWorker, WorkerDied)
        self._work = functools.partial(_in_thread, work)
        if case_limit is not None:
            self._work = functools.partial(_in_process, work, case_limit)
        self._address, self._no_workers_limit = address, no_workers_limit
        try:
            self._client: Any = distributed.Client(
                address, timeout=connect_limit, set_as_default=False
            )
        except (OSError, ValueError, TypeError) as error:
            why = " ".join(str(error).split())
            allowed = f"the address of a Dask scheduler that answers ({why})"
            fix = "for example tcp://host:8786"
            raise bad_value("scheduler", address, allowed, fix) from error
        self._executor = self._client.get_executor(pure=False)
        self._threads, self._counted_at, self._alive_at = 0, -_COUNT_EVERY_S, time.monotonic()

    def slots(self) -> int:
        """A few more tasks than threads, so that no thread has to wait."""
        return AHEAD * max(1, self._count())

    def submit(self, task: Any) -> Future[list[Row]]:
        """Send a task to any worker."""
        return self._executor.submit(self._work, task)

    def check(self) -> None:
        """See that there are workers.

        Raises:
            RopeodeError: there have been none for too long, or the scheduler has gone.
        """
        self._count()
        waited = time.monotonic() - self._alive_at
        if waited > self._no_workers_limit:
            raise RopeodeError(
                f"scheduler: {self._address} has had no workers for {waited:.0f} seconds; finished "
                "cases are kept. Fix: start workers, then run the same command again"
            )

    def close(self) -> None:
        """Cancel the tasks on the cluster, and disconnect."""
        self._executor.shutdown(wait=False)
        self._client.close()

    def _count(self) -> int:
        """Threads of all workers, counted at most once a second."""
        now = time.monotonic()
        if now - self._counted_at >= _COUNT_EVERY_S:
            try:
                self._threads = sum(self._client.nthreads().values())
            except (OSError, RuntimeError, ValueError) as error:
                raise RopeodeError(
                    f"scheduler: the connection to {self._address} is lost; finished cases are "
                    "kept. Fix: start the cluster again, then run the same command again"
                ) from error
            self._counted_at = now
            if self._threads:
                self._alive_at = now
        return self._threads


def _in_thread(work: Work, task: Any) -> list[Row]:
    """Compute a task in a thread of a worker."""
    import jax

    from ropeode.cache import use_cache_folder

    # Without a cache each worker would trace and compile all programs, which takes minutes where
    # several do so on one machine. One that the cluster's owner has chosen is left as it is.
    if jax.config.jax_compilation_cache_dir is None:  # pyright: ignore[reportAttributeAccessIssue]
        use_cache_folder()
    return on_one_core(work, task)


# Each thread of a worker has a process of its own, which starts when it is needed.
_of_thread = threading.local()


def _in_process(work: Work, case_limit: float, task: Any) -> list[Row]:
    """Compute a task in a process that this thread of a worker starts, and ends if it must."""
    if getattr(_of_thread, "work", None) != repr(work):
        _of_thread.worker, _of_thread.work = Worker(work), repr(work)
    return _of_thread.worker.run(task, case_limit)
