"""Which tasks are handed out, which have come back, and their rows put away."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from typing import Any, Protocol

from ropeode.sweep.execution.dispatch import Piece, dispatched
from ropeode.sweep.execution.engines import Engine, Row
from ropeode.sweep.storage.row_files import PARTITION, Store

# Called with the number of cases that are there, and with that of all.
Progress = Callable[[int, int], None]


class Sweep(Protocol):
    """What is asked for."""

    @property
    def count(self) -> int:
        """How many cases there are."""
        ...

    def tasks(self, first: int = 0) -> Iterator[Any]:
        """Tasks by their numbers, from `first` on."""
        ...


def work_through(sweep: Sweep, store: Store, engine: Engine, progress: Progress) -> None:
    """Have all cases worked on that are not in the store, and put them there.

    Arguments:
        sweep: whose cases they are.
        store: that nobody else writes to.
        engine: that works on them.
        progress: called at first and after each task.

    Raises:
        RopeodeError: the disk is full, or nobody is left to do the work; what is in the store
            stays there.
    """
    store.clean()
    book = Book(sweep, store)
    done = store.count()
    progress(done, sweep.count)
    for piece, rows in dispatched(book.pieces(), engine):
        book.add(piece, rows)
        done += len(rows)
        progress(done, sweep.count)


class Book:
    """What is handed out, and what has come back; merges what is complete."""

    def __init__(self, sweep: Sweep, store: Store):
        self._sweep, self._store = sweep, store
        self._under_way: Counter[int] = Counter()
        self._handed_out: set[int] = set()

    def pieces(self) -> Iterator[Piece]:
        """All tasks without the cases that are there."""
        at, known, complete = None, frozenset[str](), False
        first = PARTITION * self._first()
        for number, task in enumerate(self._sweep.tasks(first), first):
            partition, place = divmod(number, PARTITION)
            if place == 0:
                if at is not None:
                    self._pass(at)
                at, complete = partition, self._store.sealed(partition)
                known = frozenset() if complete else frozenset(self._store.keys(partition))
            left = None if complete else task.without(known)
            if left is not None:
                self._under_way[partition] += len(left.cases)
                yield Piece(left, partition)
        if at is not None:
            self._pass(at)

    def add(self, piece: Piece, rows: list[Row]) -> None:
        """Keep the rows of a piece."""
        self._store.add(piece.partition, self._store.table(piece.task.cases, rows))
        self._under_way[piece.partition] -= len(rows)
        self._seal(piece.partition)

    def _first(self) -> int:
        """The first partition that is not complete."""
        partition = 0
        while self._store.sealed(partition):
            partition += 1
        return partition

    def _pass(self, partition: int) -> None:
        self._handed_out.add(partition)
        self._seal(partition)

    def _seal(self, partition: int) -> None:
        if partition in self._handed_out and not self._under_way[partition]:
            self._store.seal(partition)
            self._handed_out.remove(partition)
            del self._under_way[partition]
