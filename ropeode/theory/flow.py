"""The exact solution near a state, to rounding: what a step is held against."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

Rates = Callable[[np.ndarray, np.ndarray], np.ndarray]

# In how many parts a solution is found: a step shows its order best where it is a few times longer
# than what one polynomial can follow to rounding.
PANELS = 4
# Stages of the collocation method, and how often its equations are iterated at most.
_STAGES, _MOST_ITERATIONS = 16, 60
# What counts as converged, and as a polynomial that has all digits of the solution.
_CLOSE, _TAIL = 4e-16, 2e-15
# No part of the longest time shorter than this is tried.
_SHORTEST = 2.0**-60


class Flow(NamedTuple):
    """Exact solutions through several states, over a short time.

    Fields:
        length: over which each is known, ``(states,)``; not-a-number where a solution is smooth
            over no time.
        slopes: the right-hand side at the collocation nodes of `PANELS` equal parts of it,
            ``(panels, states, nodes, *state)``.
    """

    length: np.ndarray
    slopes: np.ndarray

    def increments(self, fractions: np.ndarray) -> np.ndarray:
        """``y(t + fraction * length) - y(t)``, ``(states, fractions, *state)``.

        Arguments:
            fractions: from 0 to 1, ``(fractions,)``.
        """
        moved = 0.0
        for panel, slopes in enumerate(self.slopes):
            ends = np.clip(PANELS * fractions - panel, 0.0, 1.0)
            moved = moved + np.moveaxis(np.tensordot(slopes, _integrals(ends), (1, 1)), -1, 1)
        length = self.length.reshape(-1, *(1,) * (self.slopes.ndim - 2))
        return moved * (length / PANELS)


def flow(rates: Rates, t: np.ndarray, y: np.ndarray, longest: float) -> Flow:
    """The exact solutions through several states, each over a time in which it is smooth.

    By Gauss collocation (Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I,
    section II.7), whose equations are solved by fixed-point iteration. The time is halved until
    the iteration converges and the collocation polynomial shows the solution to rounding.

    Arguments:
        rates: the right-hand side for many times and states, ``(many,)`` and ``(many, *state)``.
        t: times, ``(states,)``.
        y: states, ``(states, *state)``.
        longest: time, in the problem's unit.
    """
    length = np.full(len(t), np.nan)
    slopes = np.full((PANELS, len(t), _STAGES, *y.shape[1:]), np.nan)
    first = rates(t, y)
    todo, tried = np.flatnonzero(_largest(first) < np.inf), float(longest)
    while len(todo) and tried > longest * _SHORTEST:
        now, k, done = y[todo], first[todo], np.ones(len(todo), dtype=bool)
        found = []
        for panel in range(PANELS):
            start = t[todo] + tried * panel / PANELS
            now, each, good = _panel(rates, start, now, k, tried / PANELS)
            found.append(each)
            k, done = each[:, -1], done & good
            if not np.any(done):
                break
        else:
            slopes[:, todo[done]], length[todo[done]] = np.stack(found)[:, done], tried
        todo, tried = todo[~done], tried / 2.0
    return Flow(length, slopes)


def _panel(
    rates: Rates, t: np.ndarray, y: np.ndarray, k: np.ndarray, length: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """One step of collocation from several states: their ends, slopes, and whether they are good.

    Arguments:
        k: a slope of each to begin with.
    """
    nodes, stage_weights, tail = _collocation()
    times = (t[:, None] + length * nodes).ravel()
    size = _largest(y) + np.finfo(float).tiny
    slopes = np.repeat(k[:, None], _STAGES, axis=1)
    with np.errstate(all="ignore"):
        for _ in range(_MOST_ITERATIONS):
            ahead = np.moveaxis(np.tensordot(slopes, stage_weights, (1, 1)), -1, 1)
            stages = y[:, None] + length * ahead
            again = rates(times, stages.reshape(-1, *y.shape[1:])).reshape(slopes.shape)
            moved, slopes = length * _largest(again - slopes), again
            converged = moved <= _CLOSE * size
            if np.all(converged | ~np.isfinite(moved)):
                break
        rest = length * _largest(np.moveaxis(np.tensordot(slopes, tail, (1, 1)), -1, 1))
        end = y + length * np.tensordot(slopes, _integrals(np.ones(1))[0], (1, 0))
    return end, slopes, converged & (rest <= _TAIL * size)


def _largest(states: np.ndarray) -> np.ndarray:
    """The largest component of each, ``(states,)``."""
    return np.max(np.abs(states).reshape(len(states), -1), axis=1, initial=0.0)


@functools.cache
def _collocation() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Nodes on [0, 1], the integrals up to them, and the last three Legendre coefficients."""
    z, weights = np.polynomial.legendre.leggauss(_STAGES)
    tail = _legendre_coefficients(z, weights)[-3:]
    return (z + 1.0) / 2.0, _integrals((z + 1.0) / 2.0), tail


def _legendre_coefficients(z: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """From values at the nodes to Legendre coefficients, ``(degree, node)``."""
    degrees = np.arange(_STAGES)
    basis = np.polynomial.legendre.legvander(z, _STAGES - 1)
    return (2 * degrees[:, None] + 1) / 2.0 * basis.T * weights


def _integrals(ends: np.ndarray) -> np.ndarray:
    """Integrals from 0 to each end of the polynomials that are 1 at one node, ``(ends, nodes)``."""
    z, weights = np.polynomial.legendre.leggauss(_STAGES)
    integrals = np.polynomial.legendre.legint(_legendre_coefficients(z, weights), lbnd=-1.0)
    return np.polynomial.legendre.legval(2.0 * ends - 1.0, integrals).T / 2.0
