"""Arrays whose entries are constants and expressions."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np

from ropeode.references.extended import heyoka
from ropeode.references.extended.entries import Complex


def constants(array: Any, bits: int) -> np.ndarray:
    """Numbers, without any rounding where `bits` is 53 or more."""
    real, array = heyoka().real, np.asarray(array)
    if array.dtype.kind == "c":
        parts = zip(np.ravel(array.real).tolist(), np.ravel(array.imag).tolist(), strict=True)
        return objects(array.shape, (Complex(real(re, bits), real(im, bits)) for re, im in parts))
    numbers = array.astype(np.float64).ravel().tolist()
    return objects(array.shape, (real(number, bits) for number in numbers))


def objects(shape: Sequence[int], entries: Iterable[Any]) -> np.ndarray:
    """An array of objects; NumPy would make one of numbers where all are constants."""
    listed = list(entries)
    array = np.empty(len(listed), dtype=object)
    for i, entry in enumerate(listed):
        array[i] = entry
    return array.reshape(tuple(shape))


def floats(array: np.ndarray, dtype: Any) -> np.ndarray:
    """Constants, rounded to float64.

    Arguments:
        array: of constants.
        dtype: of the result, real or complex.
    """
    numbers = [
        complex(float(entry.re), float(entry.im)) if isinstance(entry, Complex) else float(entry)
        for entry in array.flat
    ]
    return np.array(numbers, dtype=dtype).reshape(array.shape)


def each(function: Callable[..., Any], *arrays: np.ndarray) -> np.ndarray:
    """A function of numbers on each of the entries."""
    shape = np.broadcast_shapes(*(array.shape for array in arrays))
    rows = (np.broadcast_to(array, shape).flat for array in arrays)
    return objects(shape, (function(*entry) for entry in zip(*rows, strict=True)))
