"""Linear systems and Fourier transforms of constants and expressions."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from ropeode.references.extended.entries import (
    OF_ONE,
    Complex,
    conjugate,
    divide,
    each,
    multiply,
    objects,
    root_of_unity,
    subtract,
    total,
)

Params = Mapping[str, Any]

# Of the roots of unity: enough for every precision that is of use.
_BITS = 1024


def _on_matrices(function: Callable[..., np.ndarray], *arrays: np.ndarray) -> np.ndarray:
    """A function of matrices on each matrix of stacks of them."""
    batch = arrays[0].shape[:-2]
    stacks = (array.reshape(-1, *array.shape[-2:]) for array in arrays)
    results = [function(*matrices) for matrices in zip(*stacks, strict=True)]
    shape = results[0].shape if results else arrays[-1].shape[-2:]
    return objects([*batch, *shape], (entry for result in results for entry in result.flat))


def eliminated(matrix: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """The triangular factors of matrices, in one array, for given orders of their rows.

    Arguments:
        matrix: ``(..., m, n)``.
        rows: the order of the rows that pivoting has found, ``(..., m)``.
    """

    def eliminate(matrix: np.ndarray, order: np.ndarray) -> np.ndarray:
        a = matrix[order[:, 0].astype(int)].copy()
        for k in range(min(a.shape)):
            for i in range(k + 1, a.shape[0]):
                a[i, k] = divide(a[i, k], a[k, k])
                for j in range(k + 1, a.shape[1]):
                    a[i, j] = subtract(a[i, j], multiply(a[i, k], a[k, j]))
        return a

    return _on_matrices(eliminate, matrix, rows[..., None])


def triangular_solve(params: Params, matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Substitution, forwards or backwards."""
    if params["conjugate_a"]:
        matrix = each(conjugate, matrix)
    lower = params["lower"]
    if params["transpose_a"]:
        matrix, lower = np.swapaxes(matrix, -1, -2), not lower
    if not params["left_side"]:
        # x a = b is a' x' = b'.
        matrix, lower = np.swapaxes(matrix, -1, -2), not lower
        right = np.swapaxes(right, -1, -2)

    def substitute(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        x = b.copy()
        size = len(a)
        for i in range(size) if lower else reversed(range(size)):
            known = range(i) if lower else range(i + 1, size)
            for column in range(b.shape[1]):
                done = total([multiply(a[i, k], x[k, column]) for k in known])
                rest = subtract(b[i, column], done)
                x[i, column] = rest if params["unit_diagonal"] else divide(rest, a[i, i])
        return x

    solution = _on_matrices(substitute, matrix, right)
    return solution if params["left_side"] else np.swapaxes(solution, -1, -2)


def cholesky(params: Params, matrix: np.ndarray) -> np.ndarray:
    """The lower triangular factor; the upper half of the matrix is not looked at."""
    del params

    def factor(a: np.ndarray) -> np.ndarray:
        root = a.copy()
        for j in range(len(a)):
            for i in range(len(a)):
                products = [multiply(root[i, k], conjugate(root[j, k])) for k in range(j)]
                rest = subtract(a[i, j], total(products))
                if i < j:
                    root[i, j] = total([])
                elif i == j:
                    root[i, i] = OF_ONE["sqrt"](rest.re if isinstance(rest, Complex) else rest)
                else:
                    root[i, j] = divide(rest, root[j, j])
        return root

    return _on_matrices(factor, matrix)


def tridiagonal_solve(
    params: Params, lower: np.ndarray, diagonal: np.ndarray, upper: np.ndarray, right: np.ndarray
) -> np.ndarray:
    """Gauss's elimination without pivots (Thomas), as JAX has it."""
    del params
    size, columns = right.shape[-2:]
    flat = [band.reshape(-1, size) for band in (lower, diagonal, upper)]
    solutions = []
    for low, mid, up, b in zip(*flat, right.reshape(-1, size, columns), strict=True):
        above: list[Any] = []
        rows: list[list[Any]] = []
        for i in range(size):
            pivot, row = mid[i], list(b[i])
            if i:
                pivot = subtract(pivot, multiply(low[i], above[-1]))
                row = [
                    subtract(entry, multiply(low[i], before))
                    for entry, before in zip(row, rows[-1], strict=True)
                ]
            above.append(divide(up[i], pivot) if i < size - 1 else None)
            rows.append([divide(entry, pivot) for entry in row])
        for i in reversed(range(size - 1)):
            rows[i] = [
                subtract(entry, multiply(above[i], after))
                for entry, after in zip(rows[i], rows[i + 1], strict=True)
            ]
        solutions.extend(entry for row in rows for entry in row)
    return objects(right.shape, solutions)


def fourier(params: Params, array: np.ndarray) -> np.ndarray:
    """Discrete Fourier transforms along the last axes."""
    kind, lengths = int(params["fft_type"]), params["fft_lengths"]
    *others, last = range(array.ndim - len(lengths), array.ndim)
    if kind == _TO_HALF:
        array = _along(array, last)[..., : lengths[-1] // 2 + 1]
    elif kind in (_FORWARDS, _BACKWARDS):
        others.append(last)
    for axis in others:
        array = _along(array, axis, backwards=kind in (_BACKWARDS, _FROM_HALF))
    if kind == _FROM_HALF:
        array = each(_real, _along(_whole_spectrum(array, lengths[-1]), last, backwards=True))
    return array


# The kinds of transforms, as JAX numbers them.
_FORWARDS, _BACKWARDS, _TO_HALF, _FROM_HALF = range(4)


def _along(array: np.ndarray, axis: int, *, backwards: bool = False) -> np.ndarray:
    """Transforms along one axis."""
    turned = np.moveaxis(array, axis, -1)
    rows = turned.reshape(-1, turned.shape[-1])
    entries = (entry for row in rows for entry in _transform(list(row), 1 if backwards else -1))
    result = objects(turned.shape, entries)
    if backwards:
        part = root_of_unity(0, 1, _BITS).re / turned.shape[-1]
        result = each(lambda entry: multiply(entry, part), result)
    return np.moveaxis(result, -1, axis)


def _transform(row: Sequence[Any], sign: int) -> list[Any]:
    """The transform of one row, by those of its parts (Cooley and Tukey)."""
    size = len(row)
    factor = next((p for p in range(2, math.isqrt(size) + 1) if size % p == 0), size)
    if size == 1:
        return list(row)
    parts = [row[start::factor] for start in range(factor)]
    spectra = parts if factor == size else [_transform(part, sign) for part in parts]
    roots = [root_of_unity(turns, size, _BITS) for turns in range(size)]
    return [
        total(
            [
                multiply(roots[sign * start * k % size], spectrum[k % len(spectrum)])
                for start, spectrum in enumerate(spectra)
            ]
        )
        for k in range(size)
    ]


def _whole_spectrum(half: np.ndarray, size: int) -> np.ndarray:
    """The spectrum of real numbers, of which the first half is given."""
    entries = [half[..., k] for k in range(size // 2 + 1)]
    entries[0] = each(_real, entries[0])
    if size % 2 == 0:
        entries[-1] = each(_real, entries[-1])
    entries += [each(conjugate, entries[size - k]) for k in range(size // 2 + 1, size)]
    return np.stack(entries, axis=-1)


def _real(entry: Any) -> Any:
    return entry.re if isinstance(entry, Complex) else entry
