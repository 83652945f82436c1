"""The first Taylor coefficients of a function of dt, from its values at small dt > 0."""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np

# The ladder of step sizes, each the last one divided by the root of two, and the largest number of
# neighbours on it that one polynomial passes through.
RUNGS, _RATIO, _MOST = 30, 2.0**-0.5, 8
STEP_LADDER = _RATIO ** np.arange(RUNGS)
# Which polynomials a polynomial is compared with: by how many rungs they begin later, and how many
# rungs fewer they pass through.
_COMPARED = (1, 1), (2, 1)
# The extrapolation's own error is multiplied by this.
_SAFETY = 2.0
# How many functions are extrapolated at once, which bounds the memory that it takes.
_AT_ONCE = 256


def coefficient(
    values: np.ndarray, noise: np.ndarray, power: int, zeros: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The coefficient of ``dt**power`` of several functions, for the step sizes ``dt = LADDER``.

    Polynomials pass through every few neighbours on the ladder. Of all of them the one is taken
    whose estimated error is smallest: the difference from two polynomials of one degree less,
    through its finer rungs but the coarsest and through the next finer ones (of hundreds of such
    differences, some are small by accident), and what the noise of the values makes
    of it (Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, section II.9, for the
    scheme of Aitken and Neville; the choice is that of C. Ridders, Adv. Eng. Softw. 4 (1982)).

    Arguments:
        values: at the first rungs, ``(functions, rungs, components)``; what is not finite is left
            out.
        noise: how far rounding moves a value, ``(functions, rungs)``.
        power: of dt.
        zeros: how many of the first coefficients of each function are known to be zero, at most
            `power`, ``(functions,)``.

    Returns:
        The coefficients, ``(functions, components)``, and the estimated error of the largest
        component of each, ``(functions,)``; infinite where the values show no limit.
    """
    value = np.empty((len(values), values.shape[2]))
    error = np.empty(len(values))
    for known in np.unique(zeros):
        every = np.flatnonzero(zeros == known)
        for own in np.array_split(every, -(-len(every) // _AT_ONCE)):
            value[own], error[own] = _best(values[own], noise[own], power - int(known), int(known))
    return value, error


def _best(
    values: np.ndarray, noise: np.ndarray, power: int, known: int
) -> tuple[np.ndarray, np.ndarray]:
    """As `coefficient`, of functions of which the same number of coefficients is known."""
    rungs = values.shape[1]
    table, divided = _weights(power, rungs), STEP_LADDER[:rungs] ** known
    scaled = values / divided[:, None]
    usable = np.all(np.isfinite(scaled), axis=2)
    limits = table.weights @ np.where(usable[..., None], scaled, 0.0)
    unusable = ~usable @ (table.weights != 0.0).T
    shift = np.zeros(limits.shape[:2])
    for other in table.others:
        away = np.max(np.abs(limits - limits[:, other]), axis=2, initial=0.0)
        shift = np.maximum(shift, away)
    spread = (noise / divided) @ np.abs(table.weights).T
    errors = np.where(unusable | ~table.judged, np.inf, _SAFETY * shift + spread)
    best, every = np.argmin(errors, axis=1), np.arange(len(values))
    return limits[every, best], errors[every, best]


class _Weights(NamedTuple):
    """Linear forms in the values on the ladder.

    Fields:
        weights: ``(fits, RUNGS)``.
        others: of each fit, those that it is compared with, ``(comparisons, fits)``.
        judged: whether there are such, ``(fits,)``.
    """

    weights: np.ndarray
    others: np.ndarray
    judged: np.ndarray


@functools.cache
def _weights(power: int, rungs: int) -> _Weights:
    """The coefficients of ``dt**power`` of the polynomials through neighbours on the ladder."""
    rows, place = [], {}
    for count in range(power + 1, min(power + 1 + _MOST, rungs + 1)):
        nodes, own = STEP_LADDER[:count], np.zeros(count)
        for i, node in enumerate(nodes):
            others = np.delete(nodes, i)
            # All terms of a coefficient of this product have one sign: nothing cancels.
            product = np.atleast_1d(np.poly(others))[::-1]
            own[i] = product[power] / np.prod(node - others)
        for first in range(rungs - count + 1):
            place[first, count] = len(rows)
            row = np.zeros(rungs)
            # The same polynomial in steps that are shorter by one factor.
            row[first : first + count] = own / STEP_LADDER[first] ** power
            rows.append(row)
    others = [
        [place.get((first + shift, count - fewer), -1) for first, count in place]
        for shift, fewer in _COMPARED
    ]
    return _Weights(np.array(rows), np.array(others), np.all(np.array(others) >= 0, axis=0))
