"""Richardson extrapolation of runs to dt = 0, with the uncertainty of the limit."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from scipy import optimize

# Fewer runs do not show how uncertain the limit is.
FEWEST_RUNS = 3
# Terms of the error expansion that are eliminated; more would amplify rounding.
_MOST_TERMS = 6
# An order is an integer; observed with a few coarse runs it is off by at most this.
_INTEGER_TOLERANCE = 0.3
_HIGHEST_ORDER = 8.4
# The errors of two extrapolations may be larger than their difference, if they have one sign.
_SAFETY = 3.0
# Limits whose uncertainty is up to so many times the smallest are as good.
_RIVALS = 10.0
# Runs that have grown so large are not extrapolated.
_HUGE = 1e100
# Round-off in a run, relative to its values, before extrapolation amplifies it.
_ROUNDING = 100.0 * float(np.finfo(np.float64).eps)
_TINY = float(np.finfo(np.float64).tiny)


@dataclasses.dataclass(frozen=True)
class Limit:
    """The limit of one quantity of a stepper's runs as dt goes to 0.

    Arguments:
        values: at the sample times, ``(times, ...)``.
        uncertainty: estimated error at each time, ``(times,)``; it does not decrease with time.
        order: with which the runs tend to the limit; None if they do not depend on dt.
    """

    values: np.ndarray
    uncertainty: np.ndarray
    order: int | None


def limit_of(
    dts: Sequence[float], runs: Sequence[np.ndarray], rounding: float = 0.0
) -> Limit | None:
    """Richardson extrapolation to dt = 0, with the order that the runs themselves show.

    The order is that of the differences between three successive runs. With it the terms
    ``dt^p, dt^(p + 1), ...`` of the error are eliminated, one for each further run. The
    uncertainty is the largest difference to the extrapolations with one run and with two runs
    fewer, and to the one that begins at order 1, which is right whatever the order. By accident a
    difference may vanish at a sample, and with runs of order 1 the last one always does; so there
    is more than one, and the uncertainty at a sample is the largest up to the next one. Of all
    sequences of runs (the coarsest may be pre-asymptotic, the finest rounded) the one with the
    smallest uncertainty counts; how far the next ones differ from it is part of that.

    Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, section II.9.

    Arguments:
        dts: different step sizes.
        runs: the values of each run at the same times, ``(times, ...)``; runs that are not
            finite are left out.
        rounding: error of the numbers in the runs, where they have fewer digits than float64.

    Returns:
        None if no three runs tend to a limit with an integer order.
    """
    usable = [(dt, run) for dt, run in zip(dts, runs, strict=True) if np.all(np.isfinite(run))]
    if len(usable) < FEWEST_RUNS:
        return None
    usable.sort(key=lambda pair: -pair[0])
    dt = np.array([pair[0] for pair in usable])
    values = np.stack([pair[1] for pair in usable])
    # Of the finest run: coarse ones may have grown huge.
    rounding = max(rounding, _ROUNDING * float(np.max(np.abs(values[-1]))))
    if float(np.max(np.abs(values - values[-1]))) <= rounding:
        return Limit(values[-1], np.full(values.shape[1], max(2.0 * rounding, _TINY)), None)
    limits: list[Limit] = []
    for last in range(FEWEST_RUNS, len(dt) + 1):
        order = _order(dt[last - 3 : last], values[last - 3 : last], rounding)
        if order is None:
            continue
        for first in range(max(last - 1 - _MOST_TERMS, 0), last - FEWEST_RUNS + 1):
            part = slice(first, last)
            if not np.all(np.abs(values[part]) < _HUGE):
                continue
            limits.append(_extrapolated(dt[part], values[part], order, rounding))
    return _agreed(limits) if limits else None


def _agreed(limits: Sequence[Limit]) -> Limit:
    """The most certain of several limits; as uncertain as those that are hardly less so differ.

    The smallest of many uncertainties is small by accident: above all where runs are noisy, as
    those of steps that iterate up to a tolerance.
    """
    best = min(limits, key=lambda limit: limit.uncertainty[-1])
    rivals = [
        limit.values for limit in limits if limit.uncertainty[-1] <= _RIVALS * best.uncertainty[-1]
    ]
    apart = np.abs(np.stack(rivals) - best.values).reshape(len(rivals), len(best.values), -1)
    spread = _up_to_the_next(_SAFETY * np.max(apart, axis=(0, 2)))
    return dataclasses.replace(best, uncertainty=np.maximum(best.uncertainty, spread))


def _up_to_the_next(change: np.ndarray) -> np.ndarray:
    """The largest change up to the sample after each."""
    largest = np.maximum.accumulate(change)
    return np.append(largest[1:], largest[-1])


def _order(dt: np.ndarray, values: np.ndarray, rounding: float) -> int | None:
    """The integer order that the differences of three runs show; None if they show none."""
    with np.errstate(over="ignore"):  # Runs that blew up have huge numbers, and no order.
        far, near = (float(np.sqrt(np.mean((values[k] - values[k + 1]) ** 2))) for k in (0, 1))
    if not (np.isfinite(far) and rounding < near < far):
        return None

    def excess(p: float) -> float:
        scaled = (dt / dt[0]) ** p
        return np.log((scaled[0] - scaled[1]) / (scaled[1] - scaled[2])) - np.log(far / near)

    if excess(0.3) > 0 or excess(_HIGHEST_ORDER) < 0:
        return None
    observed = float(optimize.brentq(excess, 0.3, _HIGHEST_ORDER))  # pyright: ignore
    order = round(observed)
    return order if order >= 1 and abs(observed - order) <= _INTEGER_TOLERANCE else None


def _extrapolated(dt: np.ndarray, values: np.ndarray, order: int, rounding: float) -> Limit:
    weights = _weights(dt, order)
    full = np.tensordot(weights, values, 1)
    others = [
        (_SAFETY, np.tensordot(_weights(dt[1:], order), values[1:], 1)),
        (_SAFETY, np.tensordot(_weights(dt, 1), values, 1)),
    ]
    if len(dt) > FEWEST_RUNS:
        # Less accurate by two terms, so its difference needs no factor.
        others.append((1.0, np.tensordot(_weights(dt[2:], order), values[2:], 1)))
    change = np.max(
        [factor * np.abs(full - other).reshape(len(full), -1) for factor, other in others],
        axis=(0, 2),
    )
    noise = rounding * float(np.sum(np.abs(weights)))
    return Limit(full, _up_to_the_next(change) + noise, order)


def _weights(dt: np.ndarray, order: int) -> np.ndarray:
    """Weights of runs that add up to 1 and eliminate the first terms of the error."""
    scaled = dt / dt[0]
    rows = [np.ones_like(scaled), *(scaled ** (order + k) for k in range(len(dt) - 1))]
    right = np.zeros(len(dt))
    right[0] = 1.0
    return np.linalg.solve(np.stack(rows), right)
