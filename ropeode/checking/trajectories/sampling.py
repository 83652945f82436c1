"""Selects the samples at the problem's sample times, and checks all times of a file."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ropeode.checking.trajectories.layout import Written
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


class Sampled(NamedTuple):
    """The samples of a file at the wanted times.

    Fields:
        values: ``(times, nodes, columns)``, not-a-number from where the run diverged.
        interval: between the first two samples in the file; None if there is only one.
        diverged: the first number that is not finite.
    """

    values: np.ndarray
    interval: float | None
    diverged: Diverged | None


def sampled(written: Written, wanted: np.ndarray) -> Sampled:
    """Check the samples of a file, and take those at the wanted times.

    Samples must be equally spaced, except where the wanted times are not; an interval that
    ends at a wanted time may be shorter. At the first number that is not finite the run
    diverged, and nothing that follows counts.

    Arguments:
        written: in a file.
        wanted: sample times, increasing.

    Raises:
        InputError: a time is wrong or missing, or the first sample is not finite.
    """
    written, diverged = _finite_part(written)
    times, _, where = written
    if not len(times):
        allowed = "a sample at each sample time"
        raise bad_value(where(0, None, None), "no samples", allowed, "write them")
    _check_order(written)
    scale = np.maximum(np.abs(wanted), np.min(np.diff(wanted)))
    if not _is_same(times[0], wanted[0], scale[0]):
        raise bad_value(
            where(0, None, None),
            float(times[0]),
            f"the start of the problem, t = {wanted[0]:g}, as the first time",
            "write the initial state before the first step",
        )
    room = _FEW_DIGITS * scale
    if len(times) > 1:
        room = np.minimum(room, 0.25 * (times[1] - times[0]))
    found = np.searchsorted(times, wanted - room)
    found = found[found < len(times)]
    right = [_is_same(*each) for each in zip(times[found], wanted, scale, strict=False)]
    kept = found[: len(found) if all(right) else right.index(False)]
    missing = None if all(right) else int(found[len(kept)])
    _check_spacing(written, kept, missing, wanted)
    if missing is not None:
        raise bad_value(
            where(missing, None, None),
            f"t = {times[missing]:.9g} after t = {times[missing - 1]:.9g}",
            f"a sample at t = {wanted[len(kept)]:g}, which is missing",
            "check the number of steps before each sample; if dt does not divide the time, the "
            "last one is shorter",
        )
    if diverged is None and len(kept) < len(wanted):
        raise bad_value(
            where(len(times) - 1, None, None),
            f"t = {times[-1]:.9g} as the last time",
            f"samples up to t = {wanted[-1]:g}; the one at t = {wanted[len(kept)]:g} is missing",
            "make the remaining steps; if dt does not divide the time, the last one is shorter",
        )
    values = np.full((len(wanted), *written.values.shape[1:]), np.nan)
    values[: len(kept)] = written.values[kept]
    return Sampled(values, float(times[1] - times[0]) if len(times) > 1 else None, diverged)


def _finite_part(written: Written) -> tuple[Written, Diverged | None]:
    """The samples up to the first that is not finite, and that one."""
    times, values, where = written
    finite = np.isfinite(values)
    whole = finite.all(axis=(1, 2)) & np.isfinite(times)
    if whole.all():
        return written, None
    sample = int(np.argmin(whole))
    if not np.isfinite(times[sample]):
        given, node, column = times[sample], None, None
    else:
        node, column = (int(i[0]) for i in np.nonzero(~finite[sample]))
        given = values[sample, node, column]
    place = where(sample, node, column)
    if sample == 0 or not np.isfinite(times[sample]):
        fix = "start from the initial state, and write finite times in runs that diverged too"
        raise bad_value(place, float(given), "a finite number", fix)
    diverged = Diverged(float(times[sample]), place, float(given))
    return Written(times[:sample], values[:sample], where), diverged


def _check_order(written: Written) -> None:
    back = np.diff(written.times) <= 0.0
    if back.any():
        sample = int(np.argmax(back)) + 1
        raise bad_value(
            written.where(sample, None, None),
            f"t = {written.times[sample]:.9g} after t = {written.times[sample - 1]:.9g}",
            "times in increasing order, each once",
            "sort the samples, write each once, and write t with all digits",
        )


def _is_same(time: float, wanted: float, scale: float) -> bool:
    """Whether a time is the wanted one, apart from rounding to its digits."""
    if abs(time - wanted) <= _ADDED_UP * scale:
        return True
    if abs(time - wanted) > _FEW_DIGITS * scale:
        return False
    digits = len(f"{float(time)!r}".partition("e")[0].replace(".", "").strip("-0"))
    return time in (float(f"{wanted:.{max(digits, 1)}g}"), float(np.float32(wanted)))


def _check_spacing(
    written: Written, kept: np.ndarray, missing: int | None, wanted: np.ndarray
) -> None:
    """Check that the samples before one that is missing are equally spaced."""
    ends, gaps = written.times[1:missing], np.diff(written.times[:missing])
    if not len(gaps):
        return
    hit = np.isin(np.arange(1, len(gaps) + 1), kept)
    # The usual interval is the first one; where frames differ in length, the first of each frame.
    usual = np.full(len(gaps), gaps[0])
    if np.ptp(np.diff(wanted)) > _UNEQUAL * (wanted[1] - wanted[0]):
        begins = np.append(True, hit[:-1])
        usual = gaps[begins][np.cumsum(begins) - 1]
    room = _UNEQUAL * usual + _ADDED_UP * np.abs(ends)

    def wrong() -> np.ndarray:
        return (gaps > usual + room) | ((gaps < usual - room) & ~hit)

    if wrong().any():
        rounding = epsilon(ends) * np.abs(ends) + 2.0 * last_digit(ends)
        room += np.minimum(rounding, _HALF * usual)
    if wrong().any():
        i = int(np.argmax(wrong()))
        raise bad_value(
            written.where(i + 1, None, None),
            f"a time {gaps[i]:.6g} after the previous one",
            f"equal intervals, here {usual[i]:.6g}; only one that ends at a sample time may "
            "be shorter",
            "use one step size, and write every step or every k-th",
        )
