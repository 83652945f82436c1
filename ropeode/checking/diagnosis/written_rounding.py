"""How far the numbers of a trajectory are off because of how they were written."""

from __future__ import annotations

import numpy as np

from ropeode.checking.diagnosis.equation import Runs
from ropeode.checking.written_precision import epsilon, last_digit, single_precision
from ropeode.problems.problem import Problem


def rounding_of(runs: Runs, quantity: str, problem: Problem) -> float:
    """The largest error that rounding made in numbers with few digits.

    Arguments:
        runs: step size and states of each, from any program.
        quantity: that is looked at.
        problem: of which.

    Returns:
        Half a unit of the last digit that any number has; 0 where numbers have all digits of
        float64.
    """
    half = problem.quantities.index(quantity)
    values = np.concatenate([states[1:, half].ravel() for _, states in runs])
    values = values[np.isfinite(values)]
    if single_precision(values):
        return float(np.max(np.abs(values), initial=0.0)) * epsilon(values) / 2.0
    return last_digit(values)
