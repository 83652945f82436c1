"""What the times in files may mean, if they are not those of the problem."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from ropeode.checking.trajectories.layout import Written, samples_of
from ropeode.checking.written_precision import last_digit
from ropeode.problems import Problem

# Relative rounding errors of times that are added up step by step, and multiplied.
_ADDED_UP = 1e-9
# Two times are the same if they differ by less than this part of an interval.
_SAME = 1e-3
# Rounding moves a time by no more than this part of an interval.
_CLOSE = 0.1
# A unit is tried if the times with it are those of the problem to this part of the whole time.
_UNIT = 1e-3
# A step size that is this close to a divisor of the interval between samples divides it.
_WHOLE = 1e-3


class Times(NamedTuple):
    """The times of a file.

    Fields:
        all: of its samples, ``(samples,)``; not-a-number for samples that do not count.
        dt: its step size.
    """

    all: np.ndarray
    dt: float

    def moved(self, later: float) -> Times:
        """The same, so much later."""
        return self._replace(all=self.all + later)

    @property
    def first(self) -> float:
        """The first time."""
        return float(self.all[0])

    @property
    def interval(self) -> float:
        """The one between the first two times that differ; 0 if there is only one."""
        gaps = np.diff(self.all)
        return float(next(iter(gaps[gaps > 0.0]), 0.0))


@dataclasses.dataclass(frozen=True)
class Clock:
    """What the times of files mean.

    Arguments:
        words: what is wrong with them.
        fix: how to mend it.
        files: the times and the step size of each file as the problem has them.
        begins: whether the files have the initial state.
        ends: whether they have the state at the last sample time.
        room: by how much a time may be off by rounding, in the problem's unit.
    """

    words: str
    fix: str
    files: tuple[Times, ...]
    begins: bool = True
    ends: bool = True
    room: float = 0.0

    def read(self, written: Written, index: int, problem: Problem) -> Written:
        """The samples of a file with the problem's times.

        Arguments:
            written: in the file.
            index: of the file.
            problem: whose initial state is put in front where the files lack it.
        """
        times = self.files[index].all
        kept = ~np.isnan(times)
        times, values = _snapped(times[kept], problem.ts, self.room), written.values[kept]
        if not self.begins:
            first = samples_of(problem, problem.y0[None])[:, :, : values.shape[2]]
            times, values = np.append(problem.ts[0], times), np.concatenate([first, values])
        if not self.ends:  # What stands there does not count.
            times, values = np.append(times, problem.ts[-1]), np.concatenate([values, values[-1:]])
        return written._replace(times=times, values=values)


def _snapped(times: np.ndarray, wanted: np.ndarray, room: float) -> np.ndarray:
    """With the sample times themselves for times that rounding separates from them."""
    after = np.clip(np.searchsorted(wanted, times), 1, len(wanted) - 1)
    below, above = wanted[after - 1], wanted[after]
    near = np.where(times - below < above - times, below, above)
    return np.where(np.abs(times - near) <= room + _ADDED_UP * np.abs(near), near, times)


def likely_clocks(problem: Problem, files: Sequence[Times]) -> list[Clock]:
    """Clocks that would explain the first and last times of files, the simplest first.

    Arguments:
        problem: with the sample times.
        files: the times of each file.
    """
    start, end = float(problem.ts[0]), float(problem.ts[-1])
    if not files or any(each.interval <= 0.0 for each in files):
        return []
    begin = all(abs(each.first - start) <= _SAME * each.interval for each in files)
    rows = _shifted_rows(files, start) if begin else ()
    return [*rows, *_other_times(files, start, end)]


def _shifted_rows(files: Sequence[Times], start: float) -> Iterator[Clock]:
    """Rows that belong to the time of the next one, or of the one before."""
    intervals = [each.interval for each in files]
    if np.ptp(intervals) <= _SAME * intervals[0]:
        one, at = "frame", f"t = {start + intervals[0]:g}"
    else:
        one, at = "row", "the time of the next row"
    if all(abs(each.interval - each.dt) <= _SAME * each.dt for each in files):
        one, at = "step", f"t = {start:g} + dt" if start else "t = dt"
    yield Clock(
        f"each row is one {one} late: the first, at t = {start:g}, holds the state at {at}",
        "write the initial state first, and each row before the steps that follow its time",
        tuple(each.moved(each.interval) for each in files),
        begins=False,
    )
    yield Clock(
        f"each row is one {one} early: the initial state is written at {at} once more",
        "write each row after the steps that lead to its time",
        tuple(Times(np.append(np.nan, each.all[1:] - each.interval), each.dt) for each in files),
        ends=False,
    )


def _other_times(files: Sequence[Times], start: float, end: float) -> Iterator[Clock]:
    """Times from another origin or in another unit, of files with the initial state or without."""
    dts, firsts, intervals, lasts = np.array(
        [(each.dt, each.first, each.interval, each.all[-1]) for each in files]
    ).T
    for begins in (True, False):
        origins = firsts if begins else np.full(len(files), start)
        # What the unit would be of the whole motion, and of a step.
        for units in ((lasts - origins) / (end - start), 1.0 / dts):
            if np.min(units) <= 0.0:
                continue
            unit, same = float(units[0]), bool(np.ptp(units) <= _UNIT * abs(units[0]))
            counted = bool(np.all(np.abs(units * dts - 1.0) <= _UNIT))
            missing = "" if begins else ", and the initial state is missing"
            first = "" if begins else ", and the initial state first"
            if same and abs(unit - 1.0) <= _UNIT:
                if np.all(np.abs(firsts - start) <= _SAME * intervals):
                    continue
                words, fix = _of_other_start(files, start, begins)
            elif counted:
                words, fix = f"t counts steps{missing}", f"write t = step * dt{first}"
            elif same:
                ratio = f"{1.0 / unit:.6g}" if unit <= 1.0 else f"1/{unit:.6g}"
                words = f"one unit of t in the files is {ratio} of the problem's{missing}"
                fix = f"write t in the problem's unit{first}, or grade with a spec in the program's"
            # A file whose rows are equally spaced may number them.
            elif np.all(intervals == 1.0):
                words, fix = f"t counts rows{missing}", f"write the time of each row{first}"
            else:
                continue
            # Step sizes in the files may be in the unit of their times.
            steps = intervals / dts
            whole = np.all((steps >= 1.0 - _WHOLE) & (np.abs(steps - np.rint(steps)) <= _WHOLE))
            in_unit = units if same and not counted and whole else np.ones(len(files))
            read = zip(files, origins, units, in_unit.tolist(), strict=True)
            rounding = [2.0 * last_digit(each.all) for each in files]
            yield Clock(
                words,
                fix,
                tuple(Times(start + (f.all - at) / own, f.dt / dt) for f, at, own, dt in read),
                begins=begins,
                room=float(np.max(np.minimum(rounding, _CLOSE * intervals) / units)),
            )


def _of_other_start(files: Sequence[Times], start: float, begins: bool) -> tuple[str, str]:
    """What is wrong where the first time is not the start of the problem, and how to mend it."""
    firsts = [each.first for each in files]
    if np.ptp(firsts) <= _SAME * min(each.interval for each in files):
        begin = f"t = {firsts[0]:g}"
    elif all(abs(each.first - start - each.dt) <= _SAME * each.dt for each in files):
        begin = f"t = {start:g} + dt" if start else "t = dt"
    else:
        begin = "other times"
    if begins:
        words = f"the initial state is written at {begin}, and each row as much too late"
        return words, f"let t begin at {start:g}"
    words = f"the initial state is missing: the first row is that at {begin}"
    return words, "write the initial state before the first step"
