"""What the times in files may mean, if they are not those of the problem."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Sequence
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
# Two times are the same if they differ by less than this part of an interval.
_SAME = 1e-3
# Rounding moves a time by no more than this part of an interval.
_CLOSE = 0.1
# A unit is tried if the times with it are those of the problem to this part of the whole time.
_UNIT = 1e-3
# A step size that is this close to a divisor of the interval between samples divides it.
_WHOLE = 1e-3


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


def likely_clocks(problem: Problem, extents: Sequence[Extent]) -> list[Clock]:
    """Clocks that would explain the first and last times of files, the simplest first.

    Arguments:
        problem: with the sample times.
        extents: of the times of each file.
    """
    start, end = float(problem.ts[0]), float(problem.ts[-1])
    if not extents or any(each.interval <= 0.0 for each in extents):
        return []
    begin = all(abs(each.first - start) <= _SAME * each.interval for each in extents)
    found = [*_repeated(extents)]
    found += _shifted_rows(problem, extents) if begin else _other_start(extents, start)
    return [*found, *_units(extents, start, end), *_rounded(extents, start, end)]


def _repeated(extents: Sequence[Extent]) -> Iterator[Clock]:
    """Each sample twice."""
    if all(each.repeats for each in extents):
        words, fix = "samples are written twice, with the same t", "write each sample once"
        yield Clock(words, fix, tuple(_Once() for _ in extents), _dts(extents))


def _shifted_rows(problem: Problem, extents: Sequence[Extent]) -> Iterator[Clock]:
    """Rows that belong to the time of the next one, or of the one before."""
    start, intervals = float(problem.ts[0]), [each.interval for each in extents]
    if np.ptp(intervals) <= _SAME * intervals[0]:
        one, at = "frame", f"t = {start + intervals[0]:g}"
    else:
        one, at = "row", "the time of the next row"
    if all(abs(each.interval - each.dt) <= _SAME * each.dt for each in extents):
        one, at = "step", f"t = {start:g} + dt" if start else "t = dt"
    yield Clock(
        f"each row is one {one} late: the first, at t = {start:g}, holds the state at {at}",
        "write the initial state first, and each row before the steps that follow its time",
        _moved(intervals),
        _dts(extents),
        begins=False,
    )
    yield Clock(
        f"each row is one {one} early: the initial state is written at {at} once more",
        "write each row after the steps that lead to its time",
        tuple(lambda t, row, by=by: np.where(row > 0, t - by, np.nan) for by in intervals),
        _dts(extents),
        ends=False,
    )


def _other_start(extents: Sequence[Extent], start: float) -> Iterator[Clock]:
    """Files whose first time is not the start of the problem."""
    firsts = [each.first for each in extents]
    if np.ptp(firsts) <= _SAME * min(each.interval for each in extents):
        begin = f"t = {firsts[0]:g}"
    elif all(abs(each.first - start - each.dt) <= _SAME * each.dt for each in extents):
        begin = f"t = {start:g} + dt" if start else "t = dt"
    else:
        begin = "other times"
    if min(firsts) > start:
        yield Clock(
            f"the initial state is missing: the first row is that at {begin}",
            "write the initial state before the first step",
            _moved([0.0] * len(extents)),
            _dts(extents),
            begins=False,
        )
    yield Clock(
        f"the initial state is written at {begin}, and each row as much too late",
        f"let t begin at {start:g}",
        _moved([start - first for first in firsts]),
        _dts(extents),
    )


def _moved(by: Sequence[float]) -> tuple[Meaning, ...]:
    return tuple(lambda t, _, later=later: t + later for later in by)


def _dts(extents: Sequence[Extent]) -> tuple[float, ...]:
    return tuple(each.dt for each in extents)


class _Once:
    """Leaves out samples with the time of the one before, also from block to block."""

    def __init__(self) -> None:
        self._last = np.nan

    def __call__(self, times: np.ndarray, rows: np.ndarray) -> np.ndarray:
        before = np.append(self._last if rows[0] else np.nan, times[:-1])
        self._last = float(times[-1])
        return np.where(times == before, np.nan, times)


def _units(extents: Sequence[Extent], start: float, end: float) -> Iterator[Clock]:
    """Times in another unit, from zero or from the start of the problem."""
    for begins in (True, False):
        origins = [each.first if begins else 0.0 for each in extents]
        units = [
            (each.last - origin) / (end - start)
            for each, origin in zip(extents, origins, strict=True)
        ]
        steps = [1.0 / each.dt for each in extents]
        yield from _unit(extents, units, origins, start, begins)
        if not np.allclose(units, steps, rtol=_UNIT):
            yield from _unit(extents, steps, origins, start, begins)


def _unit(
    extents: Sequence[Extent],
    units: Sequence[float],
    origins: Sequence[float],
    start: float,
    begins: bool,
) -> Iterator[Clock]:
    """Times in these units of the files, if they are all the same, or all steps."""
    counted = all(
        abs(unit * each.dt - 1.0) <= _UNIT for unit, each in zip(units, extents, strict=True)
    )
    same = bool(np.ptp(units) <= _UNIT * abs(units[0]))
    # A file whose rows are equally spaced may number them.
    rows = all(each.interval == 1.0 for each in extents)
    if min(units) <= 0.0 or (same and abs(units[0] - 1.0) <= _UNIT):
        return
    if not (counted or same or rows):
        return
    unit = units[0]
    if counted:
        words, fix = "t counts steps", "write t = step * dt"
    elif rows and not same:
        words, fix = "t counts rows", "write the time of each row"
    else:
        words = f"one unit of t in the files is {_as_fraction(1.0 / unit)} of the problem's"
        fix = "write t in the problem's unit, or grade with a spec in the program's unit"
    if not begins:
        words += ", and the initial state is missing"
        fix += ", and the initial state first"

    def whole(number: float) -> bool:
        return number >= 1.0 - _WHOLE and abs(number - round(number)) <= _WHOLE

    # Step sizes in the files may be in the unit of their times.
    in_unit = same and not counted and all(whole(each.interval / each.dt) for each in extents)
    yield Clock(
        words,
        fix,
        tuple(
            lambda t, _, unit=unit, origin=origin: start + (t - origin) / unit
            for unit, origin in zip(units, origins, strict=True)
        ),
        tuple(
            each.dt / unit if in_unit else each.dt
            for each, unit in zip(extents, units, strict=True)
        ),
        begins=begins,
        room=max(
            min(2.0 * each.digits, _CLOSE * each.interval) / own
            for each, own in zip(extents, units, strict=True)
        ),
    )


def _as_fraction(number: float) -> str:
    return f"{number:.6g}" if number >= 1.0 else f"1/{1.0 / number:.6g}"


def _rounded(extents: Sequence[Extent], start: float, end: float) -> Iterator[Clock]:
    """Times with so few digits that several rows have the same."""
    if not any(each.repeats for each in extents):
        return

    def counted(gap: float, decimals: float) -> Meaning:
        def times(t: np.ndarray, row: np.ndarray) -> np.ndarray:
            even = start + row * gap
            return np.where(np.abs(t - even) <= 1.001 * decimals, even, np.nan)

        return times

    yield Clock(
        "t has so few digits that different samples have the same",
        "write t with all digits",
        tuple(counted((end - start) / (each.rows - 1), each.decimals) for each in extents),
        _dts(extents),
    )
