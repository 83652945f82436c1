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


class NoSampleMap(Exception):
    """What is carried remembers more than the samples show."""


class SampleMap:
    """One step of a stepper as a map of states, with its derivative.

    A stepper starts from a state, and what it then carries is corrected by as little as possible
    such that its sample is that state. Of a stepper whose step depends on the state alone nothing
    is to be corrected. A two-step method in positions remembers a position, which the sample shows
    as a velocity: its map goes back from a sample to what is carried. (A method that starts in
    another way than it goes on has the map of how it goes on.)

    Arguments:
        problem: does not depend on time.
        method: that is ready to run.
        y: a state that is like those to come, in the problem's shape.
        dt: a step size like those to come.

    Raises:
        NoSampleMap: there is no such map: started again at a sample, it goes on in another way.
    """

    def __init__(self, problem: Problem, method: Method, y: np.ndarray, dt: float):
        self._map = StepMap(problem, method)
        self.exact = self._map.exact
        self._every = np.ones(problem.y0.shape[1:], dtype=bool)
        self._derivatives: dict[tuple[bytes, float], np.ndarray] = {}
        first = self._map.step(self._map.start(y, dt), dt)
        second = self._map.sample(self._map.step(first, dt), dt)
        again = self(self._map.sample(first, dt), dt)
        if not np.max(np.abs(again - second)) <= _SAME * np.max(np.abs(second)):
            raise NoSampleMap

    def __call__(self, y: np.ndarray, dt: float) -> np.ndarray:
        """The next sample after a sample `y`."""
        return self._map.sample(self._map.step(self._carried(y, dt), dt), dt)

    def derivative(self, y: np.ndarray, dt: float, free: np.ndarray) -> np.ndarray:
        """Of this map, ``(free components, free components)``; of each state computed once.

        Arguments:
            y: a state.
            dt: step size.
            free: which components of the flat state to look at, ``(components,)``.
        """
        key = y.tobytes(), dt
        if key not in self._derivatives:
            carried = self._carried(y, dt)
            moving = self._map.moving(carried, self._every)
            shown = self._map.sample_derivative(carried, dt)[:, moving]
            start = self._map.start_derivative(y, dt)[moving]
            start = start + np.linalg.pinv(shown) @ (np.eye(y.size) - shown @ start)
            after = self._map.sample_derivative(self._map.step(carried, dt), dt)[:, moving]
            self._derivatives[key] = after @ self._map.derivative(carried, dt, moving) @ start
        return self._derivatives[key][free][:, free]

    def _carried(self, y: np.ndarray, dt: float) -> Any:
        """What is carried where the sample is `y`."""
        carried = self._map.start(y, dt)
        for _ in range(_ITERATIONS):
            missing = (y - self._map.sample(carried, dt)).ravel()
            if not np.all(np.isfinite(missing)):
                break
            if np.max(np.abs(missing)) <= _LEFT * np.max(np.abs(y)):
                return carried
            flat, unravel = ravel_pytree(carried)
            shown = self._map.sample_derivative(carried, dt)
            corrected: Any = np.asarray(flat) + np.linalg.pinv(shown) @ missing
            carried = unravel(corrected)
        raise NoSampleMap
