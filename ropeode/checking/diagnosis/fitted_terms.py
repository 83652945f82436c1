"""Fits of terms to a motion that was observed, for many sets of terms at once."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import NamedTuple

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
# large, according to the slopes.
_SMALL_STEP, _MOST_OF_IT = 1e-11, 0.9
# The smallest factor of all forces that a positive mass explains.
_SMALLEST = 0.01
# The most terms that are changed together.
_MOST_CHANGES = 4
# All samples are taken for sets that leave so few units of uncertainty of the first samples, or so
# small a part of what the right rope leaves; and for so many at most.
_NEARLY, _LEFT, _MOST_NEAR = 10.0, 1e-3, 24


class Group(NamedTuple):
    """Terms that one mistake changes together.

    Fields:
        terms: of `TERMS`.
        unit: what a change by 1 adds to each; chosen so that all changes are of similar size.
    """

    terms: tuple[str, ...]
    unit: float = 1.0


class Fit(NamedTuple):
    """A rope with some terms changed so that it comes close to an observed limit.

    Fields:
        groups: that could change.
        changes: of the terms of all groups in turn, in the groups' units.
        spread: how far each change may be from the true one, given the uncertainty of the limit.
        misfit: the largest difference to the limit, in units of its uncertainty.
    """

    groups: tuple[Group, ...]
    changes: np.ndarray
    spread: np.ndarray
    misfit: float

    @property
    def explains(self) -> bool:
        """Whether the differences are within the uncertainty."""
        return self.misfit <= 1.0

    def values(self) -> dict[str, float]:
        """The value of each term that could change."""
        return dict(
            zip(_names(self.groups), _values(self.groups, self.changes).tolist(), strict=True)
        )

    def spreads(self) -> dict[str, float]:
        """How far each value may be from the true one."""
        off = _units(self.groups) * self.spread
        return dict(zip(_names(self.groups), off.tolist(), strict=True))


def _names(groups: Sequence[Group]) -> list[str]:
    return [name for group in groups for name in group.terms]


def _values(groups: Sequence[Group], changes: np.ndarray) -> np.ndarray:
    """The values of the terms of some groups, ``(..., terms)``, from their changes."""
    expected = [TERMS[name].expected for name in _names(groups)]
    return np.array(expected) + _units(groups) * changes


def _units(groups: Sequence[Group]) -> np.ndarray:
    return np.array([group.unit for group in groups for _ in group.terms])


class _Trial:
    """A fit that is under way, by the method of Levenberg and Marquardt.

    SciPy's solves one problem after the other. Here all ropes of hundreds of fits move side by
    side, and each fit takes one step.

    Arguments:
        groups: that change.
        start: the changes with which it begins.
    """

    def __init__(self, groups: tuple[Group, ...], start: np.ndarray):
        self.groups, self.tried, self.done = groups, start, False
        self._damping, self._cost, self._expected = _FIRST_DAMPING, np.inf, 0.0

    def take(self, apart: np.ndarray, slopes: np.ndarray) -> None:
        """Choose the next changes from the differences of those tried, and their slopes."""
        cost = float(np.sum(apart**2))
        promised = self._cost - self._expected if self._cost < np.inf else 0.0
        if not cost < self._cost:
            self._damping *= _LARGER
        else:
            if self._cost - cost >= _AS_PROMISED * promised:
                self._damping /= _SMALLER
            self.changes, self.apart, self.slopes = self.tried, apart, slopes
            self._cost = cost
        if self._cost == np.inf:
            self.done = True
            return
        scale = np.sqrt(self._damping) * np.linalg.norm(self.slopes, axis=0)
        matrix = np.vstack([self.slopes, np.diag(scale)])
        right = np.concatenate([-self.apart, np.zeros(len(scale))])
        step = np.linalg.lstsq(matrix, right, rcond=None)[0]
        self.tried = self.changes + step
        self._expected = float(np.sum((self.apart + self.slopes @ step) ** 2))
        stays = self._expected > _MOST_OF_IT * self._cost and self._damping <= _FIRST_DAMPING
        self.done = bool(np.all(np.abs(step) <= _SMALL_STEP * (1.0 + np.abs(self.changes)))) or (
            stays and float(np.max(np.abs(self.apart))) > _NEARLY
        )

    @property
    def fit(self) -> Fit | None:
        """Where it stands; None if the rope blows up with which it began."""
        if self._cost == np.inf:
            return None
        # The error of each change if every difference is off by 1, in the worst combination.
        spread = np.sum(np.abs(np.linalg.pinv(self.slopes)), axis=1)
        fit = Fit(self.groups, self.changes, spread, float(np.max(np.abs(self.apart))))
        return fit if fit.values().get("forces", 1.0) >= _SMALLEST else None


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
        self, sets: Sequence[tuple[tuple[Group, ...], np.ndarray]], samples: int
    ) -> list[tuple[np.ndarray, np.ndarray]]:
        """From the first samples of the limit, in units of its uncertainty, with all changes.

        Returns:
            For each set of groups and changes the differences, ``(numbers,)``, and their
            derivatives, ``(numbers, changes)``.
        """
        counts = [1 + len(changes) for _, changes in sets]
        terms, ends = right_terms(sum(counts)), np.cumsum(counts)
        for (groups, changes), count, end in zip(sets, counts, ends, strict=True):
            moved = np.vstack([np.zeros(count - 1), _DIFFERENCE * np.eye(count - 1)])
            values = _values(groups, changes + moved)
            for name, value in zip(_names(groups), values.T, strict=True):
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
        self,
        sets: Sequence[tuple[tuple[Group, ...], np.ndarray]],
        samples: int,
        iterations: int = _MOST_ITERATIONS,
    ) -> list[Fit]:
        """Change sets of groups, from these changes on, so that the first samples are met."""
        trials = [_Trial(*each) for each in sets]
        with np.errstate(all="ignore"):  # Ropes that blow up.
            for _ in range(iterations):
                going = [trial for trial in trials if not trial.done]
                if not going:
                    break
                found = self._differences([(each.groups, each.tried) for each in going], samples)
                for trial, (apart, slopes) in zip(going, found, strict=True):
                    trial.take(apart, slopes)
        return [fit for trial in trials if (fit := trial.fit) is not None]

    def refined(self, fits: Sequence[Fit]) -> list[Fit]:
        """Fits to all samples, from those that are near."""
        return self.fits([(fit.groups, fit.changes) for fit in fits], self._samples)

    def explaining(
        self,
        groups: Sequence[Group],
        sizes: Iterable[int] = range(1, _MOST_CHANGES + 1),
        iterations: int = _MOST_ITERATIONS,
    ) -> Iterator[list[Fit]]:
        """Sets of groups whose change explains what is observed, by the number of their terms.

        A fit begins with the first samples, where the motion depends on the terms almost linearly;
        those that come closest are fitted to all samples.

        Arguments:
            groups: that may be changed; all forces and gravity only alone.
            sizes: how many terms change.
            iterations: at most, for the first samples.

        Yields:
            All fits with one changed term, then those with two, and so on.
        """
        first = max(self._samples // 3, 1)
        ((right, _),) = self._differences([((), np.zeros(0))], first)
        most = max(_NEARLY, _LEFT * float(np.max(np.abs(right))))
        several = [group for group in groups if group.terms != ("all",)]
        together = [
            *((group,) for group in groups),
            *(some for n in (2, 3) for some in itertools.combinations(several, n)),
        ]
        for size in sizes:
            sets = [
                (some, np.concatenate(start))
                for some in together
                if len(_names(some)) == size
                for start in itertools.product(*(_starts(group, len(some)) for group in some))
            ]
            near = [fit for fit in self.fits(sets, first, iterations) if fit.misfit <= most]
            near = sorted(near, key=lambda fit: fit.misfit)[:_MOST_NEAR]
            yield [*{fit.groups: fit for fit in self.refined(near) if fit.explains}.values()]


def _starts(group: Group, groups: int) -> list[np.ndarray]:
    """The changes of a group from which it is fitted: zero, and if it changes alone other ones."""
    term = TERMS[group.terms[0]]
    values = term.starts if groups == 1 else (term.expected,)
    return [np.full(len(group.terms), (value - term.expected) / group.unit) for value in values]
