"""Fits of terms to a motion that was observed, for many sets of terms at once."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from ropeode.checking.diagnosis.rope_forces import Terms, right_terms
from ropeode.theory.terms import TERMS, KnownMistake

# By how much a term is changed for its derivative.
_DIFFERENCE = 1e-6
# How strongly the first step of a fit is damped. If a step comes closer by this part of what the
# slopes promise, that is divided by a number; if it comes no closer, it is multiplied by another.
# And the most steps.
_FIRST_DAMPING, _SMALLER, _AS_PROMISED, _LARGER, _MOST_ITERATIONS = 1e-2, 10.0, 0.7, 4.0, 30
# A step this small beside the changes ends a fit; so does one that leaves most of a cost that is
# large, according to the slopes, and so do so many steps that together leave so much of it.
_SMALL_STEP, _MOST_OF_IT, _PATIENCE = 2e-12, 0.9, 8
# The most terms that are changed together.
_MOST_CHANGES = 3
# All samples are taken for sets that leave so few units of uncertainty of the first samples, or so
# small a part of what the right rope leaves; and for so many at most.
_NEARLY, _LEFT, _MOST_NEAR = 10.0, 1e-3, 24


# The terms that one mistake changes alike.
Change = tuple[str, ...]


class Guess(NamedTuple):
    """What may be wrong in a program.

    Fields:
        changes: of its terms.
        values: what each of them makes of its terms.
        mistakes: known ones, in place of changes by a number.
    """

    changes: tuple[Change, ...] = ()
    values: tuple[float, ...] = ()
    mistakes: tuple[KnownMistake, ...] = ()

    @property
    def terms(self) -> dict[str, Any]:
        """The values of the terms that are not right."""
        pairs = zip(self.changes, self.values, strict=True)
        terms: dict[str, Any] = {name: value for change, value in pairs for name in change}
        for mistake in self.mistakes:
            for name, value in mistake.values.items():
                terms[name] = terms.get(name, 1.0) * value
        return terms


def terms_of(guesses: Sequence[Guess]) -> Terms:
    """The terms of a copy of a program for each guess."""
    terms = right_terms(len(guesses))
    for copy, guess in enumerate(guesses):
        for name, value in guess.terms.items():
            if np.ndim(value) > terms[name].ndim - 1:
                terms[name] = np.repeat(terms[name][:, None], np.size(value), axis=1)
            terms[name][copy] = value
    return terms


class Fit:
    """A rope with some terms changed so that it comes close to what was observed.

    The method is that of Levenberg and Marquardt. SciPy's solves one problem after the other. Here
    all ropes of hundreds of fits move side by side, and each fit takes one step.

    Arguments:
        start: the changes, with the values from which it begins.
    """

    def __init__(self, start: Guess):
        self.changes, self.tried, self.done = start.changes, np.array(start.values), False
        self._damping, self._cost, self._expected = _FIRST_DAMPING, np.inf, 0.0
        self._to_beat, self._idle = np.inf, 0

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
        if self._cost < _MOST_OF_IT * self._to_beat:
            self._to_beat, self._idle = self._cost, 0
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
    def guess(self) -> Guess:
        """The changes with the values that were found."""
        return Guess(self.changes, (*self.values.tolist(),))

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
        self, guesses: Sequence[Guess], samples: int
    ) -> list[tuple[np.ndarray, np.ndarray]]:
        """From the first samples, in units of their uncertainty, with all changes of a guess.

        Returns:
            For each guess the differences, ``(numbers,)``, and their derivatives,
            ``(numbers, changes)``.
        """
        moved = [
            guess._replace(values=np.add(guess.values, step))
            for guess in guesses
            for step in _DIFFERENCE * np.eye(1 + len(guess.values), len(guess.values), -1)
        ]
        ends = np.cumsum([1 + len(guess.changes) for guess in guesses])
        states = self._motion(terms_of(moved), samples)
        weights, target = self._weights[:samples], self._target[:samples]
        apart = weights * (states.reshape(len(states), samples, -1) - target)
        apart = np.where(weights > 0.0, apart, 0.0).reshape(len(states), -1)
        apart = np.where(np.isfinite(apart), apart, np.inf)
        return [
            (part[0], np.nan_to_num((part[1:] - part[0]).T / _DIFFERENCE, posinf=0.0, neginf=0.0))
            for part in np.split(apart, ends[:-1])
        ]

    def fits(
        self, starts: Sequence[Guess], samples: int, iterations: int = _MOST_ITERATIONS
    ) -> list[Fit]:
        """Fits to the first samples."""
        fits = [Fit(start) for start in starts]
        with np.errstate(all="ignore"):  # Ropes that blow up.
            for _ in range(iterations):
                going = [fit for fit in fits if not fit.done]
                if not going:
                    break
                tried = [Guess(fit.changes, (*fit.tried.tolist(),)) for fit in going]
                found = self._differences(tried, samples)
                for fit, (apart, slopes) in zip(going, found, strict=True):
                    fit.take(apart, slopes)
        return [fit for fit in fits if fit.is_finite]

    def refined(self, fits: Sequence[Fit]) -> list[Fit]:
        """Fits to all samples, from those that are near."""
        return self.fits([fit.guess for fit in fits], self._samples)

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
        ((right, _),) = self._differences([Guess()], first)
        most = max(_NEARLY, _LEFT * float(np.max(np.abs(right))))
        for count in counts:
            starts = [
                Guess(some, start)
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
            near = [fit for fit in self.fits(starts, first, iterations) if fit.misfit <= most]
            near = sorted(near, key=lambda fit: fit.misfit)[:_MOST_NEAR]
            yield [*{fit.changes: fit for fit in self.refined(near) if fit.explains}.values()]
