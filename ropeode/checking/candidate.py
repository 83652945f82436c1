"""A stepper that is checked, and its runs."""

from __future__ import annotations

from typing import Any

import numpy as np

from ropeode.checking.check_ropes import undamped
from ropeode.problems.problem import Problem
from ropeode.simulation import simulate
from ropeode.simulation.method import Method, method_of
from ropeode.steppers.base import Stepper


class Candidate:
    """A stepper that is checked.

    Arguments:
        method: ready to run on check ropes.
    """

    def __init__(self, method: Method):
        self.method = method

    @classmethod
    def of(cls, step: Any) -> Candidate:
        """A candidate from whatever `ropeode.as_stepper` takes.

        Raises:
            InputError: there is no such stepper, or it cannot run on check ropes.
            UserCodeError: a user's step raised, or keeps hidden state.
        """
        return cls(method_of(step, undamped()))

    @property
    def stepper(self) -> Stepper:
        """The stepper itself."""
        return self.method.stepper

    @property
    def own_forces(self) -> bool:
        """Whether it computes forces of its own from `args`, and knows nothing of the drive."""
        return not self.method.trial.asks_for_forces

    def run(self, problem: Problem, steps_per_frame: int) -> np.ndarray:
        """The states at the sample times, ``(times, *state)``.

        From the first sample on whose state is not finite, all are not-a-number.

        Arguments:
            problem: a check rope.
            steps_per_frame: equal steps in each interval between sample times.

        Raises:
            UserCodeError: the user's code raised, or returned something that is no state.
        """
        states = simulate(problem, self.method, steps_per_frame).states
        missing = len(problem.ts) - len(states)
        return np.pad(states, [(0, missing)] + 3 * [(0, 0)], constant_values=np.nan)
