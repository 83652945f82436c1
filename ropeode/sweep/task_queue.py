"""The task queue: tasks go to an engine, and rows to a store, even if processes die.

When a worker dies, or its code raises, or its time is up, each case of its task is a suspect. The
task is tried again in pieces, until each suspect is alone. A case that raises gets a row with the
error. A case with which a worker died is tried again while nothing else runs, so that no neighbour
can be the cause; if the worker still dies, the case gets a row that says so. A case whose time is
up is tried once more, since it then finds compiled what it needs.
"""

from __future__ import annotations

import itertools
import time
from collections import Counter, deque
from collections.abc import Iterator
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from typing import TYPE_CHECKING

from ropeode.errors import RopeodeError
from ropeode.progress import Progress, silent
from ropeode.sweep.design.columns import DIED, TIMED_OUT, Row, failed_row
from ropeode.sweep.execution.engines import Engine, TookTooLong, WorkFailed
from ropeode.sweep.storage.row_files import Store

if TYPE_CHECKING:
    from ropeode.sweep.design.cases import Task
    from ropeode.sweep.design.spec import SweepSpec

# How often a single case may kill its process: once beside others, which may have been the cause,
# and then this often alone.
_TRIES_ALONE = 2
# Fewer would need more deaths, and more minutes for a case that hangs.
_PIECES = 8
# How often the time of a single case may be up.
_TRIES_IN_TIME = 2


def work_through(
    sweep: SweepSpec, store: Store, engine: Engine, progress: Progress = silent
) -> None:
    """Compute all cases that the store does not have, and store their rows.

    Arguments:
        sweep: whose `count` and `tasks` are used.
        store: that no other process writes to.
        engine: that computes them.
        progress: called at first and after each task.

    Raises:
        RopeodeError: the disk is full, or no worker is left; the store keeps its rows.
    """
    store.clean()
    pending: Counter[int] = Counter()  # Cases under way, by partition.
    handed_out: set[int] = set()  # Partitions whose tasks all went to the engine.

    def unfinished() -> Iterator[Task]:
        """All tasks, without the cases that have rows."""
        first = next(n for n in itertools.count() if not store.sealed(n))
        tasks = sweep.tasks(first * store.partition_size)
        for partition, numbered in itertools.groupby(tasks, store.partition_of):
            if store.sealed(partition):
                continue
            keys = store.keys(partition)
            for task in numbered:
                if rest := task.without(keys):
                    pending[partition] += len(rest.cases)
                    yield rest
            handed_out.add(partition)
            seal_if_complete(partition)

    def seal_if_complete(partition: int) -> None:
        if partition in handed_out and not pending[partition]:
            store.seal(partition)
            handed_out.remove(partition)
            del pending[partition]

    done = before = store.count()
    began = time.monotonic()
    progress(f"{done} of {sweep.count} cases", done / sweep.count)
    for task, rows in dispatched(unfinished(), engine):
        partition = store.partition_of(task)
        store.add(partition, store.table(task.cases, rows))
        pending[partition] -= len(rows)
        seal_if_complete(partition)
        done += len(rows)
        rate = (done - before) / max(time.monotonic() - began, 1e-9)
        progress(f"{done} of {sweep.count} cases, {rate:.3g} cases/s", done / sweep.count)


def dispatched(
    tasks: Iterator[Task], engine: Engine, check_every: float = 1.0
) -> Iterator[tuple[Task, list[Row]]]:
    """The rows of all tasks, whole or in parts, in the order in which they are done.

    What a worker hands back of a task may be the rows of its first cases; the rest goes back into
    the queue.

    Arguments:
        tasks: taken one by one, as the engine has room for them.
        engine: that computes them.
        check_every: seconds after which it is checked that the engine has workers.

    Raises:
        RopeodeError: a disk is full, or no worker is left.
    """
    pieces: deque[Task] = deque()
    suspects: deque[Task] = deque()
    deaths: Counter[str] = Counter()  # Of processes, by the key of the single case that they ran.
    late: Counter[str] = Counter()  # Tries whose time was up, likewise.
    running: dict[Future[list[Row]], Task] = {}
    while True:
        suspect_runs = any(task.cases[0].key in deaths for task in running.values())
        while not (suspects or suspect_runs) and len(running) < engine.slots():
            task = pieces.popleft() if pieces else next(tasks, None)
            if task is None:
                break
            running[engine.submit(task)] = task
        if suspects and not running:
            task = suspects.popleft()
            running[engine.submit(task)] = task
        if not running:
            return
        done, _ = wait(running, timeout=check_every, return_when=FIRST_COMPLETED)
        if not done:
            engine.check()
        for future in done:
            task = running.pop(future)
            first = task.cases[0]
            status, reason = _failure(future, engine)
            if not status:
                rows = future.result()
                pieces.extend(_rest(task, len(rows)))
                yield task._replace(cases=task.cases[: len(rows)]), rows
            elif len(task.cases) > 1:
                size = -(-len(task.cases) // _PIECES)
                for at in range(0, len(task.cases), size):
                    pieces.append(task._replace(cases=task.cases[at : at + size]))
            elif status == DIED and deaths[first.key] < _TRIES_ALONE:
                deaths[first.key] += 1
                suspects.append(task)
            elif status == TIMED_OUT and late[first.key] + 1 < _TRIES_IN_TIME:
                late[first.key] += 1
                pieces.append(task)
            else:
                error = future.exception()
                seconds = error.seconds if isinstance(error, TookTooLong) else None
                yield task, [failed_row(first.inputs(), status, reason, seconds)]


def _rest(task: Task, done: int) -> Iterator[Task]:
    """The cases of a task after the first ones, in parts of growing size.

    Where those took long because programs were compiled, the others need not be as few.
    """
    at, size = done, done
    while at < len(task.cases):
        yield task._replace(cases=task.cases[at : at + size])
        at, size = at + size, 2 * size


def _failure(future: Future[list[Row]], engine: Engine) -> tuple[str, str]:
    """Status and reason of a failure; empty if there was none.

    Raises:
        RopeodeError: any case would fail in this way.
    """
    try:
        error = future.exception()
    except CancelledError:
        raise RopeodeError("scheduler: it has gone; finished cases are kept") from None
    if error is None:
        return "", ""
    if isinstance(error, engine.lost):
        return DIED, "the process that ran it died each time, also when it ran alone"
    if isinstance(error, TookTooLong):
        return TIMED_OUT, f"it took longer than {error.seconds:g} s, in a process of its own"
    if isinstance(error, (OSError, RopeodeError)):
        raise RopeodeError(
            f"a worker cannot go on ({error}); finished cases are kept. Fix: remove the cause, "
            "then run the same command again"
        ) from error
    if isinstance(error, WorkFailed):
        return "failed", str(error)
    return "failed", f"{type(error).__name__}: {' '.join(str(error).split())}"
