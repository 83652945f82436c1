"""With how many digits numbers were written, and in which precision they were computed."""

from __future__ import annotations

import math

import numpy as np

# So many numbers are looked at.
_LOOKED_AT = 4096
_FLOAT32 = float(np.finfo(np.float32).eps)
# A float32 is written with up to nine digits, a float64 with up to 17.
_DIGITS_OF_FLOAT32, _DIGITS_OF_FLOAT64 = 9, 15


def digits_of(values: np.ndarray) -> tuple[int, int]:
    """The largest numbers of digits, and of decimals, that any of the numbers has.

    They are those of the shortest text that stands for it, so that nothing need be known of
    how it was written.

    Arguments:
        values: finite numbers, of any shape.
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
    """By how much the numbers may be off because of how they are written: half a last digit.

    Numbers with so many decimals have an error of the same size, and numbers with so many
    digits one relative to their own; the larger of the two is right for either.

    Arguments:
        values: finite numbers, of any shape.
    """
    digits, decimals = digits_of(values)
    largest = float(np.max(np.abs(values), initial=0.0))
    if largest == 0.0 or digits > _DIGITS_OF_FLOAT64:
        return 0.0
    return 0.5 * max(10.0**-decimals, 10.0 ** (math.floor(math.log10(largest)) + 1 - digits))


def single_precision(values: np.ndarray) -> bool:
    """Whether all the numbers are such as float32 can hold, and have digits enough to tell.

    Arguments:
        values: finite numbers, of any shape.
    """
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


def _some(values: np.ndarray) -> list[float]:
    flat = values.reshape(-1)
    return flat[:: max(1, len(flat) // _LOOKED_AT)].tolist()
