"""Whether a stepper makes the same steps as one of ropeode's."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from ropeode.json_form import json_shows
from ropeode.problems import Problem
from ropeode.simulation import Trial, method_of
from ropeode.steppers import STEPPERS, BuiltIn, Stepper, variants
from ropeode.theory.expansion import Expansion
from ropeode.theory.step_samples import StepSamples

# Steps that are compared, so that memory shows; and their sizes, as parts of the time in which a
# step can be expanded: no step is so long that it amplifies rounding.
_STEPS, _SIZES = 3, np.array([0.25, 0.0625, 0.015625])
# Rounding of a few steps, relative to the state; velocities may be differences of positions.
_SAME = 1e-12
# Where steps differ by more than this, their differences show a power of dt.
_CLEAR = 1e-10


@json_shows("name", "largest", "power", "same")
class StepDifference(NamedTuple):
    """How far the steps of two steppers are apart.

    Fields:
        name: of the other one, with its options.
        largest: difference of the states after up to three steps, relative to their size.
        power: of dt, with which the difference of one step falls; None where that does not show.
    """

    name: str
    largest: float
    power: float | None

    @property
    def same(self) -> bool:
        """Whether rounding explains the difference."""
        return self.largest <= _SAME


def step_difference(samples: StepSamples, other: BuiltIn, at: Expansion) -> StepDifference:
    """How far the steps of a stepper are from those of one of ropeode's.

    Arguments:
        samples: of the stepper on a problem.
        other: which must be able to run on it.
        at: an expansion of the stepper, at whose states and within whose reach steps are made.

    Raises:
        UserCodeError: the step raised.
    """
    return _difference(samples, other, *_cases(at))


def equal_steppers(
    samples: StepSamples,
    at: Expansion,
    *,
    lengths: bool,
    implicit: bool,
    order: Callable[[Stepper], bool],
) -> Iterator[StepDifference]:
    """The steppers of ropeode, with all their options, that make the same steps.

    Arguments:
        samples, at: as for `step_difference`.
        lengths: whether steppers that keep lengths are looked at.
        implicit: whether implicit ones are, each of which takes seconds to compile.
        order: whether the order that a stepper declares is that of these steps, which spares
            compiling it; asked for implicit steppers alone.

    Raises:
        UserCodeError: the step raised.
    """
    t, y, reach = _cases(at)
    for other in itertools.chain.from_iterable(map(variants, STEPPERS.values())):
        if other.refusal(samples.problem) is not None or (other.keeps_lengths and not lengths):
            continue
        if other.family == "implicit" and not (implicit and order(other)):
            continue
        # Most are told apart by a few steps from one state.
        if _difference(samples, other, t[-1:], y[-1:], reach[-1:]).same:
            found = _difference(samples, other, t, y, reach)
            if found.same:
                yield found


def _cases(at: Expansion) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, states and longest steps, where these are known."""
    good = np.isfinite(at.reach)
    return at.t[good], at.y[good], at.reach[good]


def _difference(
    samples: StepSamples, other: BuiltIn, t: np.ndarray, y: np.ndarray, reach: np.ndarray
) -> StepDifference:
    problem, dt = samples.problem, reach[:, None] * _SIZES
    own = samples.after(t, y, dt, _STEPS)
    others = _samples_of(problem, other).after(t, y, dt, _STEPS)
    with np.errstate(invalid="ignore", over="ignore"):
        apart = np.abs(own - others) / _size(problem, others, dt)
    # Where both are not finite they tell nothing; where one is not, they differ.
    apart[~np.isfinite(own) & ~np.isfinite(others)] = 0.0
    apart[~np.isfinite(apart)] = np.inf
    by_size = np.max(apart.reshape(*apart.shape[:3], -1), axis=(0, 3), initial=0.0)
    first, last = by_size[0, 1], by_size[-1, 1]
    power = None
    if np.isfinite(first) and last > _CLEAR:
        power = float(np.log(first / last) / np.log(_SIZES[0] / _SIZES[-1]))
    return StepDifference(other.label, float(np.max(by_size)), power)


def _samples_of(problem: Problem, stepper: BuiltIn) -> StepSamples:
    """Its steps, one by one, unless they have loops of their own: compiling takes longer."""
    method = method_of(stepper, problem)
    if not stepper.moves_links and stepper.family != "implicit":
        method = dataclasses.replace(method, trial=Trial(compiled=False))
    return StepSamples(problem, method)


def _size(problem: Problem, states: np.ndarray, dt: np.ndarray) -> np.ndarray:
    """What differences are small beside: states ``(states, sizes, steps + 1, *state)``."""
    finite = np.where(np.isfinite(states), np.abs(states), 0.0)
    size = np.full_like(states, np.max(finite) + np.finfo(np.float64).tiny)
    if problem.mechanics is not None:
        x, v = (np.max(finite[:, :, :, i]) + np.finfo(np.float64).tiny for i in range(2))
        size[:, :, :, 0] = x
        # A velocity may be a difference of positions.
        size[:, :, :, 1] = np.maximum(v, x / dt).reshape(*dt.shape, *(1,) * (states.ndim - 3))
    return size
