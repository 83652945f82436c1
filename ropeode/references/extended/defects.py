"""How far the polynomials of a Taylor series' steps are from solving the equation, in all digits.

Evaluated in float64, a right-hand side says nothing of what is below its rounding. Where errors
grow by many orders of magnitude, which extended precision is for, that may be what decides.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ropeode.problems import Problem
from ropeode.references.defect import Look
from ropeode.references.residuals import GOLDEN

# The numbers that are evaluated in all, and limits for the times: over the span, and in a step.
_NUMBERS, _FEWEST_TIMES, _MOST_TIMES, _FEWEST_IN_A_STEP = 2**17, 2**12, 2**15, 16
# So many times at once.
_BLOCK = 256
_TINY = float(np.finfo(np.float64).tiny)


class Defects:
    """The defects ``y' - f(t, y)`` of a run under way, at many times inside its steps.

    Arguments:
        problem: what is solved.
    """

    def __init__(self, problem: Problem):
        self._span = float(problem.ts[-1] - problem.ts[0])
        self._times = min(max(_NUMBERS // problem.y0.size, _FEWEST_TIMES), _MOST_TIMES)
        self._ends: list[tuple[float, float]] = []
        self._t: list[np.ndarray] = []
        self._sizes: list[np.ndarray] = []
        self._room: _Room | None = None

    def keep(self, taylor: Any, rates: Any) -> None:
        """Look into the last step.

        Arguments:
            taylor: heyoka's integrator, with the coefficients of that step.
            rates: the right-hand side, compiled.
        """
        h, end = taylor.last_h, taylor.time
        count = max(_FEWEST_IN_A_STEP, int(np.ceil(self._times * float(h) / self._span)))
        phase = (len(self._ends) * GOLDEN + 0.5) % 1.0
        places = (np.arange(count) + phase) / count
        if self._room is None:
            self._room = _Room(taylor.tc)
        found = [
            self._room.defects(taylor.tc, places[first : first + _BLOCK], h, end, rates)
            for first in range(0, count, _BLOCK)
        ]
        self._ends.append((float(end - h), float(end)))
        self._t.append(float(end) - (1.0 - places) * float(h))
        self._sizes.append(np.concatenate(found))

    def look(self, problem: Problem, differences: Mapping[str, np.ndarray]) -> Look:
        """What these defects add to the state, in units of what two runs differ by at the time.

        All that is less grows no more than that difference does, which is looked at anyway. A
        polynomial that solves the equation to the run's tolerance adds far less. So what adds
        more was not resolved, even if only its foot was hit.

        Arguments:
            problem: as far as the solution is trusted.
            differences: of this run from a coarser one, for each quantity at each sample.
        """
        low, high = np.reshape(self._ends, (-1, 2)).T
        inside = np.flatnonzero(high <= problem.ts[-1])
        low, high = low[inside], high[inside]
        counts = np.array([len(self._t[step]) for step in inside], dtype=int)
        spacing = (high - low) / counts
        frame = np.searchsorted(problem.ts, low, side="right") - 1
        small = np.stack([series[frame] for series in differences.values()], axis=1)
        small = np.maximum(np.repeat(small, problem.y0.size // len(differences), axis=1), _TINY)
        share = np.array(
            [
                np.max(np.sum(self._sizes[step], axis=0) * spacing[k] / small[k])
                for k, step in enumerate(inside)
            ]
        )
        sizes = [np.max(self._sizes[step] / small[k], axis=1) for k, step in enumerate(inside)]
        return Look(
            share=share,
            step=np.repeat(np.arange(len(inside)), counts),
            t=np.concatenate([[], *(self._t[step] for step in inside)]),
            size=np.concatenate([[], *sizes]),
            low=low,
            high=high,
            spacing=spacing,
        )


class _Room:
    """Arrays of the run's numbers that are used again and again.

    NumPy frees the memory of an array, but not what heyoka's numbers hold outside of it.

    Arguments:
        coefficients: of some step, ``(numbers, order + 1)``.
    """

    def __init__(self, coefficients: np.ndarray):
        numbers, terms = coefficients.shape
        kind = coefficients.dtype
        self._orders = np.arange(1.0, terms).astype(kind)
        self._derived = np.zeros((numbers, terms - 1), kind)
        self._times = np.zeros((3, _BLOCK), kind)
        self._powers = np.ones(terms * _BLOCK, kind)
        self._results = np.zeros((3, numbers * _BLOCK), kind)

    def defects(
        self, coefficients: np.ndarray, places: np.ndarray, h: Any, end: Any, rates: Any
    ) -> np.ndarray:
        """Their sizes at parts of a step, ``(times, numbers)``, in float64."""
        count, (numbers, terms) = len(places), coefficients.shape
        place, since, t = self._times[:, :count]
        powers = self._powers[: terms * count].reshape(terms, count)
        states, slopes, values = self._results[:, : numbers * count].reshape(3, numbers, count)
        place[:], powers[0] = places, 1.0
        np.multiply(place, h, out=since)
        np.add(since, end - h, out=t)
        for k in range(1, terms):
            np.multiply(powers[k - 1], since, out=powers[k])
        np.multiply(coefficients[:, 1:], self._orders, out=self._derived)
        np.matmul(coefficients, powers, out=states)
        np.matmul(self._derived, powers[:-1], out=slopes)
        rates(states, outputs=values, time=t)
        np.subtract(slopes, values, out=slopes)
        return np.nan_to_num(np.abs(slopes.T.astype(np.float64)), nan=np.inf)
