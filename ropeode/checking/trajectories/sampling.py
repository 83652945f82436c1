"""Selects the samples at the problem's sample times, and checks all times of a file."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from ropeode.checking.trajectories.layout import Block
from ropeode.checking.written_precision import epsilon, last_digit
from ropeode.validation import bad_value

# Relative rounding errors of times: in float64, added up step by step; and if written with few
# digits.
_ADDED_UP, _FEW_DIGITS = 1e-9, 1e-5
# Relative difference between equal intervals that is allowed beside the rounding of times.
_UNEQUAL = 1e-3
# As a part of an interval: a missing sample is detected however the times are rounded.
_HALF = 0.5


class Diverged(NamedTuple):
    """The first number of a file that is not finite.

    Fields:
        time: of its sample.
        where: the file and the place in it.
        given: the number.
    """

    time: float
    where: str
    given: float


class Sampling:
    """Takes blocks of samples in the order of time, and keeps those at the wanted times.

    Samples must be equally spaced, except where the wanted times are not; an interval that
    ends at a wanted time may be shorter. At the first number that is not finite the run
    diverged, and nothing that follows counts.

    Arguments:
        path: of the file, for complaints.
        wanted: sample times, increasing.
    """

    def __init__(self, path: Path, wanted: np.ndarray):
        self.path, self.wanted = path, wanted
        gaps = np.diff(wanted)
        self._equal = bool(np.ptp(gaps) <= _UNEQUAL * gaps[0])
        self._scale = np.maximum(np.abs(wanted), np.min(gaps))
        self._kept: list[np.ndarray] = []
        self._last: tuple[float, str] | None = None
        self._into_frame = 0
        self.interval: float | None = None
        self.diverged: Diverged | None = None

    def take(self, block: Block) -> None:
        """Check a block and keep its wanted samples.

        Raises:
            InputError: a time is wrong, or the first sample is not finite.
        """
        block = self._finite_part(block)
        if not len(block.times):
            return
        self._check_order(block)
        if self._last is None and not self._same(float(block.times[0]), 0):
            first = float(block.times[0])
            raise bad_value(
                self._at(block, 0),
                first,
                f"the start of the problem, t = {self.wanted[0]:g}, as the first time",
                "write the initial state before the first step",
            )
        hits, missing = self._pick(block)
        self._check_spacing(block, hits, len(hits) if missing is None else missing)
        if missing is not None:
            self._complain_of_missing(block, missing)
        self._last = float(block.times[-1]), self._at(block, len(block.times) - 1)

    def finish(self) -> np.ndarray:
        """The values at all wanted times, ``(times, nodes, columns)``.

        They are not-a-number from where the run diverged.

        Raises:
            InputError: the file ends before the last of them.
        """
        missing = len(self._kept)
        if self._last is None:
            raise bad_value(
                str(self.path), "no samples", "a sample at each sample time", "write them"
            )
        if self.diverged is not None:
            lost = np.full_like(self._kept[0], np.nan)
            return np.stack([*self._kept, *[lost] * (len(self.wanted) - missing)])
        if missing < len(self.wanted):
            last, where = self._last
            raise bad_value(
                where,
                f"t = {last:.9g} as the last time",
                f"samples up to t = {self.wanted[-1]:g}; the one at t = "
                f"{self.wanted[missing]:g} is missing",
                "make the remaining steps; if dt does not divide the time, the last one is shorter",
            )
        return np.stack(self._kept)

    def _at(self, block: Block, sample: int) -> str:
        return f"{self.path}, {block.where(sample, None, None)}"

    def _finite_part(self, block: Block) -> Block:
        """The samples up to the first that is not finite, which is remembered."""
        finite, times = np.isfinite(block.values), np.isfinite(block.times)
        if finite.all() and times.all():
            return block
        sample = int(np.argmin(finite.all(axis=(1, 2)) & times))
        if not times[sample]:
            given, node, column = block.times[sample], None, None
        else:
            node, column = (int(i[0]) for i in np.nonzero(~finite[sample]))
            given = block.values[sample, node, column]
        where = f"{self.path}, {block.where(sample, node, column)}"
        if not times[sample] or (self._last is None and sample == 0):
            fix = "start from the initial state, and write finite times in runs that diverged too"
            raise bad_value(where, float(given), "a finite number", fix)
        self.diverged = Diverged(float(block.times[sample]), where, float(given))
        return Block(block.times[:sample], block.values[:sample], block.where)

    def _check_order(self, block: Block) -> None:
        before = np.empty_like(block.times)
        before[0] = -np.inf if self._last is None else self._last[0]
        before[1:] = block.times[:-1]
        back = block.times <= before
        if not back.any():
            return
        sample = int(np.argmax(back))
        raise bad_value(
            self._at(block, sample),
            f"t = {block.times[sample]:.9g} after t = {before[sample]:.9g}",
            "times in increasing order, each once",
            "sort the samples, write each once, and write t with all digits",
        )

    def _same(self, time: float, index: int) -> bool:
        """Whether a time is the wanted one, apart from rounding to its digits."""
        wanted, scale = float(self.wanted[index]), float(self._scale[index])
        if abs(time - wanted) <= _ADDED_UP * scale:
            return True
        if abs(time - wanted) > _FEW_DIGITS * scale:
            return False
        digits = len(f"{time!r}".partition("e")[0].replace(".", "").strip("-0"))
        return time in (float(f"{wanted:.{max(digits, 1)}g}"), float(np.float32(wanted)))

    def _pick(self, block: Block) -> tuple[np.ndarray, int | None]:
        """Keep wanted samples; returns which, and the first one before which one is missing."""
        hits = np.zeros(len(block.times), dtype=bool)
        first = len(self._kept)
        room = _FEW_DIGITS * self._scale[first:]
        if self.interval is not None or len(block.times) > 1:
            step = self.interval or float(block.times[1] - block.times[0])
            room = np.minimum(room, 0.25 * step)
        begins = np.searchsorted(block.times, self.wanted[first:] - room)
        for index, begin in enumerate(begins[begins < len(block.times)], first):
            sample = int(begin)
            if not self._same(float(block.times[sample]), index):
                return hits, sample
            hits[sample] = True
            self._kept.append(block.values[sample].copy())
        return hits, None

    def _complain_of_missing(self, block: Block, sample: int) -> None:
        after = float(block.times[sample])
        before = float(block.times[sample - 1]) if sample else (self._last or (np.nan, ""))[0]
        raise bad_value(
            self._at(block, sample),
            f"t = {after:.9g} after t = {before:.9g}",
            f"a sample at t = {self.wanted[len(self._kept)]:g}, which is missing",
            "check the number of steps before each sample; if dt does not divide the time, the "
            "last one is shorter",
        )

    def _check_spacing(self, block: Block, hits: np.ndarray, count: int) -> None:
        """Check that the first `count` samples of the block are equally spaced."""
        start = 1 if self._last is None else 0
        before = np.append([] if self._last is None else self._last[0], block.times[:-1])
        ends, hit = block.times[start:count], hits[start:count]
        gaps = ends - before[: len(ends)]
        if not len(gaps):
            return
        if self.interval is None:
            self.interval = float(gaps[0])
        if self._equal:
            usual = np.full(len(gaps), self.interval)
        else:
            usual = self._usual_in_frames(gaps, hit)
        room = _UNEQUAL * usual + _ADDED_UP * np.abs(ends)

        def wrong() -> np.ndarray:
            return (gaps > usual + room) | ((gaps < usual - room) & ~hit)

        if not wrong().any():
            return
        rounding = epsilon(block.times) * np.abs(ends) + 2.0 * last_digit(block.times)
        room += np.minimum(rounding, _HALF * usual)
        if not wrong().any():
            return
        i = int(np.argmax(wrong()))
        raise bad_value(
            self._at(block, start + i),
            f"a time {gaps[i]:.6g} after the previous one",
            f"equal intervals, here {usual[i]:.6g}; only one that ends at a sample time may "
            "be shorter",
            "use one step size, and write every step or every k-th",
        )

    def _usual_in_frames(self, gaps: np.ndarray, hit: np.ndarray) -> np.ndarray:
        """For frames of unequal length: the first interval in the frame of each gap."""
        usual = np.empty_like(gaps)
        for i, gap in enumerate(gaps):
            if self._into_frame == 0:
                self._first_in_frame = float(gap)
            usual[i] = self._first_in_frame
            self._into_frame = 0 if hit[i] else self._into_frame + 1
        return usual
