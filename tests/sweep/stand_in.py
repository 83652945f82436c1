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
from typing import NamedTuple

from ropeode import sandbox
from ropeode.sweep import COLUMNS, INPUTS, InProcess, Store, failed_row, read_parts, work_through


@dataclasses.dataclass(frozen=True)
class Case:
    number: int

    @property
    def key(self) -> str:
        return hashlib.sha256(f"case {self.number}".encode()).hexdigest()

    def inputs(self) -> dict:
        return {**dict.fromkeys(INPUTS), "key": self.key, "stepper": "rk4", "draw": self.number}


class Task(NamedTuple):
    number: int
    cases: tuple[Case, ...]

    def without(self, keys) -> Task | None:
        left = tuple(case for case in self.cases if case.key not in keys)
        return self._replace(cases=left) if left else None


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
        does: of cases, what they do: "die", "die once", "raise" or "hang", or what they say in
            place of rows.
        notes: a folder with a note of each case that has died once.
    """

    seconds: float = 0.0
    does: Mapping[int, str | bytes] = dataclasses.field(default_factory=dict)
    notes: Path = Path()

    def __call__(self, task: Task) -> list[dict]:
        time.sleep(self.seconds)
        for case in task.cases:
            does, note = self.does.get(case.number, ""), self.notes / str(case.number)
            if does == "die once" and not note.exists():
                note.touch()
                does = "die"
            if does == "die":
                os.kill(os.getpid(), signal.SIGKILL)
            if does == "raise":
                raise ArithmeticError(f"number {case.number}")
            if isinstance(does, bytes):
                sandbox.say(does)
            if does == "hang" or isinstance(does, bytes):
                time.sleep(3600.0)
        return [row(case) for case in task.cases]


def expected(sweep: Sweep) -> list[dict]:
    return [{"case": n, **row(Case(n))} for n in range(sweep.count)]


def stored(folder: Path) -> list[dict]:
    return [row for table in read_parts(folder) for row in table.to_pylist()]


def compute(sweep: Sweep, folder: Path, rows=Rows()) -> None:
    """Run a sweep in this process, with partitions of five tasks, so that few cases have many."""
    work_through(sweep, Store(folder, COLUMNS, partition_size=5), InProcess(rows))
