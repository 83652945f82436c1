"""Tasks given to an engine, and their rows, whatever becomes of the processes.

When a worker dies, or its code raises, the cases of its task are suspects. They are tried again
in halves, until a case is by itself. One that raises gets a row that says so. One with which a
worker died is tried again with nothing else under way, so that no neighbour can be the cause;
what still dies there gets its row.
"""

from __future__ import annotations

import dataclasses
from collections import deque
from collections.abc import Iterator
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from typing import Any

from ropeode.errors import InputError, RopeodeError
from ropeode.sweep.design.columns import failed_row
from ropeode.sweep.execution.engines import Engine, Row

DIED = "worker-died"
_CHECK_EVERY_S = 1.0
# How often a case that is by itself may take its process along: once beside others, which may
# have been the cause, and so often alone.
_TRIES_ALONE = 2


@dataclasses.dataclass(frozen=True)
class Piece:
    """A task of a sweep, or what is left of it.

    Arguments:
        task: with the cases that are to be worked on.
        partition: that its rows belong to.
        deaths: how many processes it has taken along, since it is a single case.
    """

    task: Any
    partition: int
    deaths: int = 0


def dispatched(pieces: Iterator[Piece], engine: Engine) -> Iterator[tuple[Piece, list[Row]]]:
    """The rows of all pieces, in the order in which they are done.

    Arguments:
        pieces: taken one by one, as the engine has room for them.
        engine: that works on them.

    Raises:
        RopeodeError: a disk is full, or nobody is left to do the work.
    """
    again: deque[Piece] = deque()
    alone: deque[Piece] = deque()
    running: dict[Future[list[Row]], Piece] = {}
    while True:
        lonely = alone or any(piece.deaths for piece in running.values())
        while not lonely and len(running) < engine.slots():
            piece = again.popleft() if again else next(pieces, None)
            if piece is None:
                break
            running[engine.submit(piece.task)] = piece
        if alone and not running:
            piece = alone.popleft()
            running[engine.submit(piece.task)] = piece
        if not running:
            return
        done, _ = wait(running, timeout=_CHECK_EVERY_S, return_when=FIRST_COMPLETED)
        if not done:
            engine.check()
        for future in done:
            piece = running.pop(future)
            status, reason = _failure(future, engine)
            if not status:
                yield piece, future.result()
            elif len(piece.task.cases) > 1:
                again.extend(_halves(piece))
            elif status == DIED and piece.deaths < _TRIES_ALONE:
                alone.append(dataclasses.replace(piece, deaths=piece.deaths + 1))
            else:
                yield piece, [failed_row(piece.task.cases[0].values(), status, reason)]


def _failure(future: Future[list[Row]], engine: Engine) -> tuple[str, str]:
    """Status and reason of what went wrong; empty where nothing did.

    Raises:
        RopeodeError: it would go wrong with any case.
    """
    try:
        error = future.exception()
    except CancelledError:
        raise RopeodeError("scheduler: it is gone; finished cases are kept") from None
    if error is None:
        return "", ""
    if isinstance(error, engine.lost):
        return DIED, "the process that ran it died each time, alone too"
    if isinstance(error, (OSError, InputError)):
        raise RopeodeError(
            f"a worker cannot go on ({error}); finished cases are kept. Fix: mend that, and give "
            "the same command again"
        ) from error
    return "failed", f"{type(error).__name__}: {' '.join(str(error).split())}"


def _halves(piece: Piece) -> list[Piece]:
    """Two pieces with half of the cases each."""
    keys = [case.key for case in piece.task.cases]
    middle = len(keys) // 2
    halves = (piece.task.without(set(keys[middle:])), piece.task.without(set(keys[:middle])))
    return [Piece(half, piece.partition) for half in halves]
