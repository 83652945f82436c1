"""The map from one sample of a stepper to the next, where there is one."""

from __future__ import annotations

from typing import Any

import numpy as np
from jax.flatten_util import ravel_pytree

from ropeode.problems import Problem
from ropeode.simulation import Method, StepMap

# Relative: how closely a step after a new start must be the second step, of what is as exact as
# the states are.
_SAME = 1e-9
# Newton's method for what is carried where a sample is wanted: iterations, and what is left.
_ITERATIONS, _LEFT = 8, 1e-12
# A derivative that is worse conditioned has no inverse.
_CONDITION = 1e10


class NoSampleMap(Exception):
    """What is carried remembers more than the samples show."""


class SampleMap:
    """One step of a stepper as a map of states, with its derivative.

    Of a stepper whose step depends on the state alone that is a start, a step, and the sample. A
    two-step method in positions remembers a position; it carries as many numbers as a state
    has, and each sample shows all of them: its map goes back from a sample to what is carried.
    (A method that starts in another way than it goes on has the map of how it goes on.)

    Arguments:
        problem: does not depend on time.
        method: that is ready to run.
        y: a state that is like those to come, in the problem's shape.
        dt: a step size like those to come.

    Raises:
        NoSampleMap: there is no such map.
    """

    def __init__(self, problem: Problem, method: Method, y: np.ndarray, dt: float):
        self._map = StepMap(problem, method)
        self.exact = self._map.exact
        first = self._map.step(self._map.start(y, dt), dt)
        sample = self._map.sample(first, dt)
        second = self._map.sample(self._map.step(first, dt), dt)
        again = self._map.sample(self._map.step(self._map.start(sample, dt), dt), dt)
        size = np.max(np.abs(second))
        starts_there = np.max(np.abs(self._map.first_sample(y, dt) - y)) <= _SAME * size
        self.has_memory = not (starts_there and np.max(np.abs(again - second)) <= _SAME * size)
        if self.has_memory and np.size(ravel_pytree(first)[0]) != y.size:
            raise NoSampleMap

    def __call__(self, y: np.ndarray, dt: float) -> np.ndarray:
        """The next sample after a sample `y`."""
        return self._map.sample(self._map.step(self._carried(y, dt), dt), dt)

    def derivative(self, y: np.ndarray, dt: float, free: np.ndarray) -> np.ndarray:
        """Of this map, ``(free components, free components)``.

        Arguments:
            y: a state.
            dt: step size.
            free: which components of the flat state to look at, ``(components,)``.
        """
        if not self.exact and not self.has_memory:
            return self._map.differences(
                lambda near: self(near.reshape(y.shape), dt).ravel(), y.ravel(), free
            )
        carried = self._carried(y, dt)
        after = self._map.step(carried, dt)
        every = np.ones(np.size(ravel_pytree(carried)[0]), dtype=bool)
        step = self._map.derivative(carried, dt, every)
        moved = self._map.sample_derivative(after, dt) @ step
        if self.has_memory:
            before = self._inverse(self._map.sample_derivative(carried, dt))
        else:
            before = self._map.start_derivative(y, dt)
        return (moved @ before)[free][:, free]

    def _carried(self, y: np.ndarray, dt: float) -> Any:
        """What is carried where the sample is `y`."""
        if not self.has_memory:
            return self._map.start(y, dt)
        flattened, unravel = ravel_pytree(self._map.start(y, dt))
        flat: Any = np.array(flattened)
        for _ in range(_ITERATIONS):
            carried = unravel(flat)
            missing = (y - self._map.sample(carried, dt)).ravel()
            flat = flat + self._inverse(self._map.sample_derivative(carried, dt)) @ missing
            if np.max(np.abs(missing)) <= _LEFT * np.max(np.abs(y)):
                return unravel(flat)
        raise NoSampleMap

    def _inverse(self, matrix: np.ndarray) -> np.ndarray:
        if not np.all(np.isfinite(matrix)) or np.linalg.cond(matrix) > _CONDITION:
            raise NoSampleMap
        return np.linalg.inv(matrix)
