"""How many digits the numbers of a trajectory were printed with."""

from __future__ import annotations

import numpy as np

from ropeode.grading.diagnosis.equation import Runs
from ropeode.problems.problem import Problem

# Decimal digits of float64.
_DIGITS = 15


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
    values = values[np.isfinite(values) & (values != 0.0)]
    if not len(values):
        return 0.0
    if np.array_equal(values, values.astype(np.float32)):
        return float(np.max(np.abs(values)) * np.finfo(np.float32).eps / 2.0)
    largest = np.floor(np.log10(np.max(np.abs(values))))
    decimals = next((d for d in range(_DIGITS) if _same(values, np.round(values, d))), None)
    figures = next((d for d in range(1, _DIGITS) if _same(values, _to_figures(values, d))), None)
    errors = [
        *([] if decimals is None else [0.5 * 10.0**-decimals]),
        *([] if figures is None else [0.5 * 10.0 ** (largest - figures + 1)]),
    ]
    # The larger: with so many figures, small numbers have more decimals than large ones.
    return max(errors, default=0.0)


def _same(values: np.ndarray, rounded: np.ndarray) -> bool:
    return bool(np.max(np.abs(values - rounded) / np.abs(values)) <= 4.0 * np.finfo(np.float64).eps)


def _to_figures(values: np.ndarray, figures: int) -> np.ndarray:
    unit = 10.0 ** (np.floor(np.log10(np.abs(values))) - figures + 1)
    return np.round(values / unit) * unit
