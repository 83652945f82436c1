"""A sweep whose cases cost nothing, for tests of what happens to processes and files.

It imports no solver, so that a process that runs it starts fast.
"""

from __future__ import annotations

import dataclasses
import hashlib
import os
import signal
import time
from collections.abc import Mapping
from pathlib import Path

from ropeode import sandbox
from ropeode.sweep import (
    COLUMNS,
    INPUTS,
    InProcess,
    Store,
    failed_row,
    read_parts,
    work_through,
)


@dataclasses.dataclass(frozen=True)
class Case:
    number: int

    @property
    def key(self) -> str:
        return hashlib.sha256(f"case {self.number}".encode()).hexdigest()

    def inputs(self) -> dict:
        return {**dict.fromkeys(INPUTS), "key": self.key, "stepper": "rk4", "draw": self.number}


@dataclasses.dataclass(frozen=True)
class Task:
    number: int
    cases: tuple[Case, ...]

    def without(self, keys) -> Task | None:
        left = tuple(case for case in self.cases if case.key not in keys)
        return self._replace(cases=left) if left else None

    def _replace(self, **changes) -> Task:
        return dataclasses.replace(self, **changes)


@dataclasses.dataclass(frozen=True)
class Sweep:
    count: int
    per_task: int = 4

    columns = COLUMNS

    def tasks(self, first: int = 0):
        for number in range(first, -(-self.count // self.per_task)):
            start = number * self.per_task
            stop = min(start + self.per_task, self.count)
            yield Task(number, tuple(map(Case, range(start, stop))))


def row(case: Case) -> dict:
    """A row that depends on the case alone, with numbers of all lengths."""
    plain = failed_row(case.inputs(), "ok", "")
    return {**plain, "error_max": 1.0 / (case.number + 3), "resolved": case.number % 3 > 0}


@dataclasses.dataclass(frozen=True)
class Rows:
    """Computes a task: nothing, for some seconds.

    Arguments:
        seconds: to sleep.
        deadly: cases that kill their process.
        deadly_once: cases that kill the first process that runs them.
        notes: a folder with a note of each case that has killed once.
        raising: cases that raise.
        slow: cases that never end.
        saying: of cases, what they say in place of rows.
    """

    seconds: float = 0.0
    deadly: frozenset[int] = frozenset()
    deadly_once: frozenset[int] = frozenset()
    notes: Path = Path()
    raising: frozenset[int] = frozenset()
    slow: frozenset[int] = frozenset()
    saying: Mapping[int, bytes] = dataclasses.field(default_factory=dict)

    def __call__(self, task: Task) -> list[dict]:
        time.sleep(self.seconds)
        for case in task.cases:
            note = self.notes / str(case.number)
            if case.number in self.deadly_once and not note.exists():
                note.touch()
                os.kill(os.getpid(), signal.SIGKILL)
            if case.number in self.deadly:
                os.kill(os.getpid(), signal.SIGKILL)
            if case.number in self.slow:
                time.sleep(3600.0)
            if case.number in self.saying:
                sandbox.say(self.saying[case.number])
                time.sleep(3600.0)
            if case.number in self.raising:
                raise ArithmeticError(f"number {case.number}")
        return [row(case) for case in task.cases]


def expected(sweep: Sweep) -> list[dict]:
    return [{"case": n, **row(Case(n))} for n in range(sweep.count)]


def stored(folder: Path) -> list[dict]:
    return [row for table in read_parts(folder) for row in table.to_pylist()]


def compute(sweep: Sweep, folder: Path, rows=Rows()) -> None:
    """Run a sweep in this process, with partitions of five tasks, so that few cases have many."""
    work_through(sweep, Store(folder, COLUMNS, partition_size=5), InProcess(rows))
