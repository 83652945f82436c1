"""Fractions that floating-point numbers stand for."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from ropeode.tableaus.stages import Number

# As large as the denominators of published methods (Dormand and Prince have 18656). Of the numbers
# that stand for no fraction, one in a hundred thousand is so close to one by accident.
_LARGEST = 100_000
# What is left of a coefficient when a step has multiplied and divided by it.
_ROUNDING = 8 * np.finfo(np.float64).eps


def as_fraction(value: float) -> Number:
    """The fraction with a small denominator that a number is the rounding of; else the number.

    Arguments:
        value: a finite number; the nearest fraction must agree to the last bits.
    """
    fraction = Fraction(value).limit_denominator(_LARGEST)
    if abs(float(fraction) - value) <= _ROUNDING * max(abs(value), 0.125):
        return fraction
    return value
