"""A sweep whose cases cost nothing, for tests of what happens to processes and files.

It can be imported without JAX, so that a process that runs it starts in no time.
"""

from __future__ import annotations

import dataclasses
import hashlib
import os
import time
from pathlib import Path

from ropeode.sweep.design.columns import COLUMNS, INPUTS, failed_row
from ropeode.sweep.execution.engines import InProcess
from ropeode.sweep.execution.task_queue import work_through
from ropeode.sweep.storage.row_files import Store, read_parts


@dataclasses.dataclass(frozen=True)
class Case:
    number: int
    word: str = "case"

    @property
    def key(self) -> str:
        return hashlib.sha256(f"{self.word} {self.number}".encode()).hexdigest()

    def values(self) -> dict:
        return {**dict.fromkeys(INPUTS), "key": self.key, "stepper": "rk4", "draw": self.number}


@dataclasses.dataclass(frozen=True)
class Task:
    cases: tuple[Case, ...]

    def without(self, keys) -> Task | None:
        left = tuple(case for case in self.cases if case.key not in keys)
        return Task(left) if left else None


@dataclasses.dataclass(frozen=True)
class Sweep:
    count: int
    per_task: int = 4

    columns = COLUMNS

    def tasks(self, first: int = 0):
        for start in range(first * self.per_task, self.count, self.per_task):
            stop = min(start + self.per_task, self.count)
            yield Task(tuple(map(Case, range(start, stop))))


def row(case: Case) -> dict:
    """A row that depends on the case alone, with numbers of all lengths."""
    found = failed_row(case.values(), "ok", "")
    return {**found, "error_max": 1.0 / (case.number + 3), "resolved": case.number % 3 > 0}


@dataclasses.dataclass(frozen=True)
class Rows:
    """What is done with a task: nothing, for some seconds; some cases kill their process."""

    seconds: float = 0.0
    deadly: frozenset[int] = frozenset()
    raising: frozenset[int] = frozenset()

    def __call__(self, task: Task) -> list[dict]:
        time.sleep(self.seconds)
        for case in task.cases:
            if case.number in self.deadly:
                os.kill(os.getpid(), 9)
            if case.number in self.raising:
                raise ArithmeticError(f"number {case.number}")
        return [row(case) for case in task.cases]


def expected(sweep: Sweep) -> list[dict]:
    return [{"case": n, **row(Case(n))} for n in range(sweep.count)]


def stored(folder: Path) -> list[dict]:
    return [row for table in read_parts(folder) for row in table.to_pylist()]


def run(folder: Path, count: int, seconds: float) -> None:
    """Run a sweep as a process of its own does it."""
    store = Store(folder, COLUMNS)
    work_through(Sweep(count), store, InProcess(Rows(seconds)), lambda done, total: None)
