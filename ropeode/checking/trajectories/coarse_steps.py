"""The order of runs in single precision, from the coarse steps that round-off does not decide."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np

from ropeode.analysis import FEWEST_POINTS, ROUND_OFF, LeftOut, ObservedOrder
from ropeode.checking.report import Convergence, Quantity

# Round-off grows as dt shrinks, so that it never makes errors fall with a power of dt. By chance
# three of them may lie on a line; where round-off may be that large, it takes one more, and an
# interval that is not wider than this.
_FEWEST, _WIDEST = FEWEST_POINTS + 1, 0.4
# Where all errors fall with at least this power of dt, round-off does not decide any of them: they
# do not lie on the line of the coarse steps for another reason.
_FALLING = 0.5
# Round-off grows at least with this power of 1/dt, like a random walk. Where it is such a part of
# the error at the finest step that counts, an order over a factor of 3 in dt is off by 0.13.
_GROWTH, _SMALL = 0.5, 0.15


def by_coarse_steps(
    observe: Callable[[int], Convergence], careful: Convergence, share: float
) -> Convergence:
    """The orders of the most runs, from the coarsest on, that show one.

    The finer ones are left out only if errors stop falling there, and the largest round-off
    explains how far they are from what that order predicts, and is small at the finest that
    counts. Quantities that show no order so, or whose runs tend to something else than the
    solution, keep what they have.

    Arguments:
        observe: the convergence of so many runs, from the coarsest on, as they are written.
        careful: that of all of them, without those that the largest round-off may decide.
        share: the part of the largest round-off that it has as rounding.
    """
    counts = range(len(careful.dts), FEWEST_POINTS, -1)
    parts = [(count, observe(count)) for count in counts]
    quantities = dict(careful.quantities)
    for name, whole in careful.quantities.items():
        for count, part in parts:
            order = part.orders[name]
            if part.quantities[name].has_wrong_limit():
                continue
            if _is_shown(order, whole, np.array(careful.dts), share, count):
                finer = tuple(LeftOut(dt, ROUND_OFF) for dt in careful.dts[count:])
                shown = dataclasses.replace(order, left_out=order.left_out + finer)
                quantities[name] = dataclasses.replace(whole, order=shown)
                break
    return dataclasses.replace(careful, quantities=quantities)


def _is_shown(
    order: ObservedOrder, whole: Quantity, dts: np.ndarray, share: float, count: int
) -> bool:
    """Whether so many runs show an order, and round-off explains the others."""
    if order.verdict != "converges" or order.observed is None or order.ci95 is None:
        return False
    worst = np.array(whole.rounding) / share
    errors = np.array([np.inf if each is None else each for each in whole.errors])
    finest = int(np.flatnonzero(dts == order.used[-1])[0])
    doubtful = LeftOut(order.used[-1], ROUND_OFF) in whole.order.left_out
    predicted = errors[finest] * (dts[count:] / dts[finest]) ** order.observed
    rounding = np.abs(errors[count:] - predicted)
    at_finest = rounding * (dts[count:] / dts[finest]) ** _GROWTH
    explained = (rounding <= worst[count:]) & (at_finest <= _SMALL * errors[finest])
    least = errors[count - 1 : -1] * (dts[count:] / dts[count - 1 : -1]) ** _FALLING
    if count < len(dts) and np.all(errors[count:] < least):
        return False
    if doubtful and (len(order.used) < _FEWEST or order.ci95[1] - order.ci95[0] > _WIDEST):
        return False
    return bool(explained.all())
