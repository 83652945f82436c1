"""What the times in files may mean, if they are not those of the problem."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from ropeode.checking.trajectories.layout import Block, samples_of
from ropeode.checking.written_precision import digits_of, last_digit
from ropeode.problems import Problem

# Relative rounding errors of times that are added up step by step, and multiplied.
_ADDED_UP = 1e-9

# The problem's times, from the times in a file and the numbers of its rows, all ``(samples,)``; not
# a number for rows that do not count.
Meaning = Callable[[np.ndarray, np.ndarray], np.ndarray]


class Extent(NamedTuple):
    """The times of a file.

    Fields:
        dt: its step size.
        first: the first time.
        interval: between the first two times that differ; 0 if there is only one.
        last: the last time.
        rows: how many samples there are.
        repeats: whether some sample has the same time as the one before it.
        digits: the largest rounding error of times with so few digits; 0 in full.
        decimals: one unit of the last decimal.
    """

    dt: float
    first: float
    interval: float
    last: float
    rows: int
    repeats: bool
    digits: float
    decimals: float


def extent_of(blocks: Iterator[Block], dt: float) -> Extent:
    """The times of all samples of a file."""
    first = last = np.nan
    interval, rows, repeats, digits, decimals = 0.0, 0, False, 0.0, 0
    for block in blocks:
        times = block.times
        if not len(times):
            continue
        gaps = np.diff(times, prepend=last if rows else times[0])
        repeats |= bool(np.any(gaps[0 if rows else 1 :] == 0.0))
        if not interval and np.any(gaps > 0.0):
            interval = float(gaps[gaps > 0.0][0])
        first, last = (first if rows else float(times[0])), float(times[-1])
        rows += len(times)
        digits, decimals = max(digits, last_digit(times)), max(decimals, digits_of(times)[1])
    return Extent(dt, first, interval, last, rows, repeats, digits, 10.0**-decimals)


@dataclasses.dataclass(frozen=True)
class Clock:
    """What the times of files mean.

    Arguments:
        words: what is wrong with them.
        fix: how to mend it.
        times: what those of each file mean.
        dts: the step size of each file, in the problem's unit.
        begins: whether the files have the initial state.
        ends: whether they have the state at the last sample time.
        room: by how much a time may be off by rounding, in the problem's unit.
    """

    words: str
    fix: str
    times: tuple[Meaning, ...]
    dts: tuple[float, ...]
    begins: bool = True
    ends: bool = True
    room: float = 0.0

    def blocks(self, blocks: Iterator[Block], index: int, problem: Problem) -> Iterator[Block]:
        """The samples of a file with the problem's times.

        Arguments:
            blocks: of the file.
            index: of the file.
            problem: whose initial state is put in front where the files lack it.
        """
        rows = 0
        for block in blocks:
            if not rows and not self.begins:
                first = samples_of(problem, problem.y0[None])[:, :, : block.values.shape[2]]
                yield Block(problem.ts[:1], first, _nowhere)
            numbers = np.arange(rows, rows + len(block.times))
            rows += len(numbers)
            times = self.times[index](block.times, numbers)
            kept = np.flatnonzero(~np.isnan(times))
            if len(kept):
                moved = _snapped(times[kept], problem.ts, self.room)
                yield Block(moved, block.values[kept], _nowhere)


def _nowhere(sample: int, node: int | None, column: int | None) -> str:
    """Complaints about another reading of a file are shown to nobody."""
    return f"sample {sample}, {node}, {column}"


def _snapped(times: np.ndarray, wanted: np.ndarray, room: float) -> np.ndarray:
    """With the sample times themselves for times that rounding separates from them."""
    after = np.clip(np.searchsorted(wanted, times), 1, len(wanted) - 1)
    below, above = wanted[after - 1], wanted[after]
    near = np.where(times - below < above - times, below, above)
    return np.where(np.abs(times - near) <= room + _ADDED_UP * np.abs(near), near, times)
