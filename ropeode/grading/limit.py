"""Where runs lead to as dt goes to zero, and whether that is the solution."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

# Terms of the error's expansion that are taken off, at most.
_MOST_TERMS = 4


@dataclasses.dataclass(frozen=True, eq=False)
class Limit:
    """The limit of runs for dt to zero.

    Arguments:
        states: there, ``(times, *state)``.
        uncertainty: of each sample, ``(times,)``: how far the limit moves if a term less is
            taken off, or the coarsest run is left out; the larger of both.
    """

    states: np.ndarray
    uncertainty: np.ndarray


def limit_of(runs: Sequence[tuple[float, np.ndarray]], order: int) -> Limit | None:
    """Extrapolate runs to dt = 0.

    The error of a one-step method with equal steps has an expansion ``e_p dt^p + e_(p+1)
    dt^(p+1) + ...``; its first terms are fitted and taken off.

    Arguments:
        runs: step size and states ``(times, *state)`` of each, different in step size and
            finite.
        order: p, the first power.

    Returns:
        None where there are fewer than three runs.

    Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, section II.8.
    """
    runs = sorted(runs, key=lambda run: run[0])
    if len(runs) < 3:
        return None
    terms = min(_MOST_TERMS, len(runs) - 1)
    # Not all runs: the coarse ones are beyond what few terms can tell.
    finest = runs[: terms + 1]
    best = _extrapolated(finest, order, terms)
    others = (
        _extrapolated(runs[:terms], order, terms - 1),
        _extrapolated(runs[1 : terms + 1], order, terms - 1),
    )
    axes = tuple(range(1, best.ndim))
    apart = [np.max(np.abs(other - best), axis=axes) for other in others]
    return Limit(best, np.maximum.accumulate(np.max(apart, axis=0)))


def _extrapolated(runs: Sequence[tuple[float, np.ndarray]], order: int, terms: int) -> np.ndarray:
    """The constant of a fit with so many powers of dt."""
    dts = np.array([dt for dt, _ in runs])
    scaled = dts / dts[-1]
    powers = np.column_stack([np.ones(len(runs)), *(scaled ** (order + k) for k in range(terms))])
    weights = np.linalg.pinv(powers)[0]
    return np.tensordot(weights, np.stack([states for _, states in runs]), axes=1)
