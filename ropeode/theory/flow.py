"""The exact solution near a state, to rounding: what a step is held against."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

Rates = Callable[[np.ndarray, np.ndarray], np.ndarray]

# In how many parts a short time is divided: a step shows its order best where it is a few times
# longer than what one polynomial can follow to rounding.
_PANELS = 4
# Stages of the collocation method, and how often its equations are iterated at most.
_STAGES, _MOST_ITERATIONS = 16, 60
# An iteration that gains less than this in each round, from some round on, has no hope.
_SLOW, _PATIENCE, _ROUNDED = 0.8, 8, 1e-12
# What counts as converged, and as a polynomial that has all digits of the solution.
_CLOSE, _TAIL = 4e-16, 2e-15
# The disturbance of time, in units of its last place, that shows what its rounding does to slopes;
# and how many times that a polynomial may miss.
_DISTURBANCE, _ROUGH = 64.0, 16.0
# No part of the longest time shorter than this is tried.
_SHORTEST = 2.0**-60


class Flow(NamedTuple):
    """Exact solutions through several states, to rounding.

    Fields:
        length: over which each is known, ``(states,)``; not-a-number where it is not.
        slopes: the right-hand side at the collocation nodes of equal parts of it,
            ``(panels, states, nodes, *state)``.
    """

    length: np.ndarray
    slopes: np.ndarray

    def increments(self, fractions: np.ndarray) -> np.ndarray:
        """``y(t + fraction * length) - y(t)``, ``(states, fractions, *state)``.

        Arguments:
            fractions: from 0 to 1, ``(fractions,)``.
        """
        panels = len(self.slopes)
        weights = np.stack(
            [_integrals(np.clip(panels * fractions - k, 0.0, 1.0)) for k in range(panels)]
        )
        moved = np.tensordot(weights, self.slopes, ((0, 2), (0, 2)))
        length = self.length.reshape(-1, *(1,) * (self.slopes.ndim - 2))
        return np.moveaxis(moved, 0, 1) * (length / panels)


def short_flow(rates: Rates, t: np.ndarray, y: np.ndarray, longest: float | np.ndarray) -> Flow:
    """The exact solutions through several states, each over a time in which it is smooth.

    By Gauss collocation (Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I,
    section II.7), whose equations are solved by fixed-point iteration. The time is halved until
    the iteration converges and the collocation polynomials show the solution to rounding.

    Arguments:
        rates: the right-hand side for many times and states, ``(many,)`` and ``(many, *state)``.
        t: times, ``(states,)``.
        y: states, ``(states, *state)``.
        longest: time, in the problem's unit; of all states, or of each, ``(states,)``.
    """
    longest = np.broadcast_to(longest, np.shape(t))
    length = np.full(len(t), np.nan)
    slopes = np.full((_PANELS, len(t), _STAGES, *y.shape[1:]), np.nan)
    todo, part = np.flatnonzero(largest(rates(t, y)) < np.inf), 1.0
    # Late in time the rounding of time shows in the slopes, and no polynomial follows that.
    rough = np.zeros(len(t))
    for time in (t, t + longest):
        late = time + _DISTURBANCE * np.spacing(np.abs(time))
        change = largest(rates(late, y) - rates(time, y)) / _DISTURBANCE
        rough = np.fmax(rough, change)
    while len(todo) and part > _SHORTEST:
        tried = part * longest[todo]
        found, good = _chain(rates, t[todo], y[todo], tried, rough[todo])
        if found is not None:
            slopes[:, todo[good]], length[todo[good]] = found[:, good], tried[good]
        todo, part = todo[~good], part / 2.0
    return Flow(length, slopes)


def _chain(
    rates: Rates, t: np.ndarray, y: np.ndarray, length: np.ndarray, rough: np.ndarray
) -> tuple[np.ndarray | None, np.ndarray]:
    """Slopes at the nodes of each of `_PANELS` panels, if any solution is good; and which are."""
    good, found = np.ones(len(t), dtype=bool), []
    k = rates(t, y)
    for panel in range(_PANELS):
        y, slopes, fine = _panel(rates, t + length * panel / _PANELS, y, k, length / _PANELS, rough)
        good &= fine
        if not np.any(good):
            return None, good
        found.append(slopes)
        k = slopes[:, -1]
    return np.stack(found), good


def _panel(
    rates: Rates,
    t: np.ndarray,
    y: np.ndarray,
    k: np.ndarray,
    length: np.ndarray,
    rough: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """One step of collocation from several states: their ends, slopes, and whether they are good.

    Arguments:
        k: a slope of each to begin with.
        rough: how far the rounding of time moves a slope of each.
    """
    nodes, stage_weights, tail = _collocation()
    times = (t[:, None] + length[:, None] * nodes).ravel()
    size = largest(y) + length * largest(k) + np.finfo(float).tiny
    slopes = np.repeat(k[:, None], _STAGES, axis=1)
    long = length.reshape(-1, *(1,) * (slopes.ndim - 1))
    with np.errstate(all="ignore"):
        moved = np.full(len(t), np.inf)
        for iteration in range(_MOST_ITERATIONS):
            stages = y[:, None] + long * _weighted(stage_weights, slopes)
            again = rates(times, stages.reshape(-1, *y.shape[1:])).reshape(slopes.shape)
            before, moved, slopes = moved, length * largest(again - slopes), again
            converged = moved <= _CLOSE * size
            # Near the end an iteration may dwell on rounding for a while.
            slow = (moved > _SLOW * before) & (moved > _ROUNDED * size)
            hopeless = slow & (iteration >= _PATIENCE)
            if np.all(converged | hopeless | ~np.isfinite(moved)):
                break
        rest = length * largest(_weighted(tail, slopes))
        end = y + (long * _weighted(_integrals(np.ones(1)), slopes))[:, 0]
    return end, slopes, converged & (rest <= _TAIL * size + _ROUGH * length * rough)


def _weighted(weights: np.ndarray, slopes: np.ndarray) -> np.ndarray:
    """Sums over the nodes, ``(states, sums, *state)``."""
    return np.moveaxis(np.tensordot(weights, slopes, (1, 1)), 0, 1)


def largest(states: np.ndarray) -> np.ndarray:
    """The largest component of each, ``(states,)``."""
    return np.max(np.abs(states).reshape(len(states), -1), axis=1, initial=0.0)


@functools.cache
def _legendre() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Nodes on [-1, 1], the Legendre coefficients of values there, and series of derivatives.

    Returns:
        ``(nodes,)``; ``(degree, node)``; and ``(term, degree)``, of each polynomial from degree 1.
    """
    z, weights = np.polynomial.legendre.leggauss(_STAGES)
    basis = np.polynomial.legendre.legvander(z, _STAGES - 1)
    coefficients = (2 * np.arange(_STAGES)[:, None] + 1) / 2.0 * basis.T * weights
    return z, coefficients, np.polynomial.legendre.legder(np.eye(_STAGES)[1:], axis=1).T


@functools.cache
def _collocation() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Nodes on [0, 1], the integrals up to them, and the last three Legendre coefficients."""
    z, coefficients, _ = _legendre()
    return (z + 1.0) / 2.0, _integrals((z + 1.0) / 2.0), coefficients[-3:]


def _integrals(ends: np.ndarray) -> np.ndarray:
    """Integrals from 0 to each end of the polynomials that are 1 at one node, ``(ends, nodes)``.

    The integral of a Legendre polynomial from -1 to z is ``(z**2 - 1) P_k'(z)/(k (k + 1))``, whose
    first factor is small where the end is: so a short increment is right to rounding of itself.
    """
    _, coefficients, derivatives = _legendre()
    orders = np.arange(1, _STAGES)
    slopes = np.polynomial.legendre.legval(2.0 * ends - 1.0, derivatives)
    above = -2.0 * ends * (1.0 - ends) * slopes / (orders * (orders + 1))[:, None]
    return np.vstack([ends, above]).T @ coefficients
