"""How many digits printed numbers have, and in which precision they were computed."""

from __future__ import annotations

import math

import numpy as np

# At most so many numbers are examined.
_SAMPLE = 4096
_FLOAT32 = float(np.finfo(np.float32).eps)
# A float32 needs up to nine digits; a number with more than 15 is a float64 in full.
_DIGITS_OF_FLOAT32, DIGITS_OF_FLOAT64 = 9, 15


def digits_of(values: np.ndarray) -> tuple[int, int]:
    """The largest numbers of digits and of decimals among some numbers.

    Counted in the shortest text that stands for each number, whatever the file contained.
    """
    digits = decimals = 0
    for value in _some(values):
        mantissa, _, exponent = repr(abs(value)).partition("e")
        whole, _, fraction = mantissa.partition(".")
        fraction = fraction.rstrip("0")
        digits = max(digits, len((whole + fraction).strip("0")))
        decimals = max(decimals, len(fraction) - int(exponent or 0))
    return digits, decimals


def last_digit(values: np.ndarray) -> float:
    """The largest error of rounding to the digits that the numbers have: half a last digit.

    A fixed number of decimals gives an error of one size, a fixed number of digits one relative
    to each number; the larger of the two bounds either.
    """
    digits, decimals = digits_of(values)
    largest = float(np.max(np.abs(values), where=np.isfinite(values), initial=0.0))
    if largest == 0.0 or digits > DIGITS_OF_FLOAT64:
        return 0.0
    return 0.5 * max(10.0**-decimals, 10.0 ** (math.floor(math.log10(largest)) + 1 - digits))


def single_precision(values: np.ndarray) -> bool:
    """Whether float32 can hold all the numbers, and they have enough digits to decide it."""
    some = _some(values)
    with np.errstate(over="ignore"):
        near = np.array(some, dtype=np.float64).astype(np.float32).astype(np.float64)
    if np.array_equal(near, some):
        return bool(np.any(near != np.rint(near)))
    digits, _ = digits_of(values)
    if not 7 < digits <= _DIGITS_OF_FLOAT32:
        return False
    return all(float(f"{a:.{digits}g}") == b for a, b in zip(near, some, strict=True))


def epsilon(values: np.ndarray) -> float:
    """The relative rounding of the precision in which the numbers were computed."""
    return _FLOAT32 if single_precision(values) else float(np.finfo(np.float64).eps)


def rounding_of(values: np.ndarray) -> float:
    """The largest error of rounding the numbers to float32, or to the digits that they have.

    Returns:
        0 for numbers with all digits of float64.
    """
    if single_precision(values):
        return float(np.max(np.abs(values), initial=0.0)) * _FLOAT32 / 2.0
    return last_digit(values)


def _some(values: np.ndarray) -> list[float]:
    flat = values[np.isfinite(values)]
    return flat[:: max(1, len(flat) // _SAMPLE)].tolist()
