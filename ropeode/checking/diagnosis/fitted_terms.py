"""Fits of terms to a motion that was observed, for many sets of terms at once."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np

from ropeode.checking.diagnosis.rope_forces import Terms, right_terms
from ropeode.theory.terms import TERMS

# By how much a term is changed for its derivative.
_DIFFERENCE = 1e-6
# How strongly the first step of a fit is damped. If a step comes closer by this part of what the
# slopes promise, that is divided by a number; if it comes no closer, it is multiplied by another.
# And the most steps.
_FIRST_DAMPING, _SMALLER, _AS_PROMISED, _LARGER, _MOST_ITERATIONS = 1e-2, 10.0, 0.7, 4.0, 30
# A step this small beside the changes ends a fit; so does one that leaves most of a cost that is
# large, according to the slopes, and so do so many steps that together leave half of it.
_SMALL_STEP, _MOST_OF_IT, _PATIENCE = 1e-11, 0.9, 8
# The most terms that are changed together.
_MOST_CHANGES = 3
# All samples are taken for sets that leave so few units of uncertainty of the first samples, or so
# small a part of what the right rope leaves; and for so many at most.
_NEARLY, _LEFT, _MOST_NEAR = 10.0, 1e-3, 24


# The terms that one mistake changes alike.
Change = tuple[str, ...]
# Some changes, and the value that each gives to its terms.
Valued = tuple[tuple[Change, ...], np.ndarray]


class Fit:
    """A rope with some terms changed so that it comes close to what was observed.

    The method is that of Levenberg and Marquardt. SciPy's solves one problem after the other. Here
    all ropes of hundreds of fits move side by side, and each fit takes one step.

    Arguments:
        changes: of terms.
        start: the values with which it begins.
    """

    def __init__(self, changes: tuple[Change, ...], start: np.ndarray):
        self.changes, self.tried, self.done = changes, start, False
        self._damping, self._cost, self._expected = _FIRST_DAMPING, np.inf, 0.0
        self._to_halve, self._idle = np.inf, 0

    def take(self, apart: np.ndarray, slopes: np.ndarray) -> None:
        """Choose the next values from the differences of those tried, and their slopes."""
        cost = float(np.sum(apart**2))
        promised = self._cost - self._expected if self._cost < np.inf else 0.0
        if not cost < self._cost:
            self._damping *= _LARGER
            self.done = not self.is_finite
        else:
            if self._cost - cost >= _AS_PROMISED * promised:
                self._damping /= _SMALLER
            self.values, self._apart, self._slopes = self.tried, apart, slopes
            self._cost = cost
        if self.done:
            return
        scale = np.sqrt(self._damping) * np.linalg.norm(self._slopes, axis=0)
        # Slopes of a rope that nearly blew up may be too large to take a step by.
        if not np.all(np.isfinite(scale)):
            self.done = True
            return
        self._idle += 1
        if self._cost < 0.5 * self._to_halve:
            self._to_halve, self._idle = self._cost, 0
        matrix = np.vstack([self._slopes, np.diag(scale)])
        right = np.concatenate([-self._apart, np.zeros(len(scale))])
        step = np.linalg.lstsq(matrix, right, rcond=None)[0]
        self.tried = self.values + step
        self._expected = float(np.sum((self._apart + self._slopes @ step) ** 2))
        stays = self._expected > _MOST_OF_IT * self._cost and self._damping <= _FIRST_DAMPING
        small = np.all(np.abs(step) <= _SMALL_STEP * (1.0 + np.abs(self.values)))
        hopeless = (stays or self._idle >= _PATIENCE) and self.misfit > _NEARLY
        self.done = bool(small) or hopeless

    @property
    def is_finite(self) -> bool:
        """Whether the rope with which it began did not blow up."""
        return self._cost < np.inf

    @property
    def misfit(self) -> float:
        """The largest difference from what was observed, in units of its uncertainty."""
        return float(np.max(np.abs(self._apart)))

    @property
    def explains(self) -> bool:
        """Whether the differences are within the uncertainty."""
        return self.misfit <= 1.0

    @property
    def spread(self) -> np.ndarray:
        """The error of each value if every difference is off by 1, in the worst combination."""
        return np.sum(np.abs(np.linalg.pinv(self._slopes)), axis=1)


class Fitting:
    """Changes terms so that a rope moves as it was observed to.

    Arguments:
        motion: of copies of the rope with given terms, at the first samples.
        states: that are observed, ``(1 + samples, *numbers)``.
        uncertainty: of each, of the same shape.
    """

    def __init__(
        self,
        motion: Callable[[Terms, int], np.ndarray],
        states: np.ndarray,
        uncertainty: np.ndarray,
    ):
        self._motion, self._samples = motion, len(states) - 1
        self._weights = 1.0 / uncertainty[1:].reshape(self._samples, -1)
        self._target = np.nan_to_num(states[1:]).reshape(self._weights.shape)

    def _differences(
        self, sets: Sequence[Valued], samples: int
    ) -> list[tuple[np.ndarray, np.ndarray]]:
        """From the first samples, in units of their uncertainty, with all changes of a set.

        Returns:
            For each set the differences, ``(numbers,)``, and their derivatives,
            ``(numbers, changes)``.
        """
        counts = [1 + len(changes) for changes, _ in sets]
        terms, ends = right_terms(sum(counts)), np.cumsum(counts)
        for (changes, values), count, end in zip(sets, counts, ends, strict=True):
            moved = np.vstack([np.zeros(len(values)), _DIFFERENCE * np.eye(len(values))])
            for change, value in zip(changes, (values + moved).T, strict=True):
                for name in change:
                    terms[name][end - count : end] = value
        states = self._motion(terms, samples)
        weights, target = self._weights[:samples], self._target[:samples]
        apart = weights * (states.reshape(len(states), samples, -1) - target)
        apart = np.where(weights > 0.0, apart, 0.0).reshape(len(states), -1)
        apart = np.where(np.isfinite(apart), apart, np.inf)
        return [
            (part[0], np.nan_to_num((part[1:] - part[0]).T / _DIFFERENCE, posinf=0.0, neginf=0.0))
            for part in np.split(apart, ends[:-1])
        ]

    def fits(
        self, sets: Sequence[Valued], samples: int, iterations: int = _MOST_ITERATIONS
    ) -> list[Fit]:
        """Fits of sets of changes, from these values on, to the first samples."""
        fits = [Fit(*each) for each in sets]
        with np.errstate(all="ignore"):  # Ropes that blow up.
            for _ in range(iterations):
                going = [fit for fit in fits if not fit.done]
                if not going:
                    break
                found = self._differences([(fit.changes, fit.tried) for fit in going], samples)
                for fit, (apart, slopes) in zip(going, found, strict=True):
                    fit.take(apart, slopes)
        return [fit for fit in fits if fit.is_finite]

    def refined(self, fits: Sequence[Fit]) -> list[Fit]:
        """Fits to all samples, from those that are near."""
        return self.fits([(fit.changes, fit.values) for fit in fits], self._samples)

    def explaining(
        self,
        changes: Sequence[Change],
        counts: Iterable[int] = range(1, _MOST_CHANGES + 1),
        iterations: int = _MOST_ITERATIONS,
    ) -> Iterator[list[Fit]]:
        """Sets of changes that explain what is observed, by their number.

        A fit begins with the first samples, where the motion depends on the terms almost linearly;
        those that come closest are fitted to all samples.

        Arguments:
            changes: that may be made; that of the whole acceleration only alone.
            counts: of the changes.
            iterations: at most, for the first samples.

        Yields:
            All fits with one change, then those with two, and so on.
        """
        first = max(self._samples // 3, 1)
        ((right, _),) = self._differences([((), np.zeros(0))], first)
        most = max(_NEARLY, _LEFT * float(np.max(np.abs(right))))
        for count in counts:
            sets = [
                (some, np.array(start))
                for some in itertools.combinations(changes, count)
                if count == 1 or all(change != ("all",) for change in some)
                # From several values only where a change is made alone.
                for start in itertools.product(
                    *(
                        TERMS[names[0]].starts if count == 1 else [TERMS[names[0]].expected]
                        for names in some
                    )
                )
            ]
            near = [fit for fit in self.fits(sets, first, iterations) if fit.misfit <= most]
            near = sorted(near, key=lambda fit: fit.misfit)[:_MOST_NEAR]
            yield [*{fit.changes: fit for fit in self.refined(near) if fit.explains}.values()]
