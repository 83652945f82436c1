"""What primitives of JAX are on heyoka's expressions and on exact constants.

An array is a NumPy array of objects, each of which is a constant (a `heyoka.real` with guard
bits) or an expression that depends on the state or the time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import jax
import numpy as np

from ropeode.references.extended import heyoka
from ropeode.references.extended.entries import (
    CHOICES,
    OF_ONE,
    OF_TWO,
    add,
    divide,
    multiply,
    subtract,
    total,
)
from ropeode.references.extended.jaxprs import bind

Params = Mapping[str, Any]

# Bits that constants have beyond the precision of the solution.
GUARD_BITS = 64

# Primitives that put numbers elsewhere and compute nothing.
MOVES = {
    "slice",
    "dynamic_slice",
    "dynamic_update_slice",
    "concatenate",
    "pad",
    "squeeze",
    "reshape",
    "broadcast_in_dim",
    "transpose",
    "rev",
    "gather",
    "scatter",
    "select_n",
    "split",
    "stack",
    "unstack",
    "tile",
    "copy",
}


def constants(array: Any, bits: int) -> np.ndarray:
    """Numbers, without any rounding where `bits` is 53 or more."""
    real = heyoka().real
    return objects(np.shape(array), (real(number, bits) for number in np.ravel(array).tolist()))


def objects(shape: Sequence[int], entries: Iterable[Any]) -> np.ndarray:
    """An array of objects; NumPy would make one of numbers where all are constants."""
    listed = list(entries)
    array = np.empty(len(listed), dtype=object)
    for i, entry in enumerate(listed):
        array[i] = entry
    return array.reshape(tuple(shape))


def floats(array: np.ndarray) -> np.ndarray:
    """Constants, rounded to float64."""
    return np.array([float(entry) for entry in array.flat], dtype=float).reshape(array.shape)


def moved(equation: Any, inputs: Sequence[np.ndarray]) -> list[np.ndarray] | None:
    """The results of one of `MOVES`, by sending numbered places through it.

    Arguments:
        equation: of a jaxpr.
        inputs: arrays of objects, and of plain numbers (indices and the like).

    Returns:
        None where a place does not exist.
    """
    places: list[np.ndarray] = []
    entries: list[Any] = []
    for array in inputs:
        start = len(entries)
        if array.dtype == object:
            entries.extend(array.flat)
            array = np.arange(start, len(entries), dtype=np.float64).reshape(array.shape)
        places.append(array)
    results = [np.asarray(result) for result in bind(equation, places)]
    if not all(np.all(np.isfinite(result)) for result in results):
        return None
    return [objects(r.shape, (entries[int(place)] for place in r.flat)) for r in results]


def _each(function: Callable[..., Any], *arrays: np.ndarray) -> np.ndarray:
    """A function of numbers on each of the entries."""
    arrays = tuple(np.broadcast_arrays(*arrays))
    entries = zip(*(array.flat for array in arrays), strict=True)
    return objects(arrays[0].shape, (function(*entry) for entry in entries))


def _on_each(function: Callable[..., Any]) -> Callable[..., np.ndarray]:
    return lambda params, *arrays: _each(function, *arrays)


def _integer_power(params: Params, base: np.ndarray) -> np.ndarray:
    return _each(lambda entry: entry ** float(params["y"]), base)


def _reduce_sum(params: Params, array: np.ndarray) -> np.ndarray:
    return _over_axes(total, array, params["axes"])


def _reduce_product(params: Params, array: np.ndarray) -> np.ndarray:
    return _over_axes(lambda row: _folded(multiply, row)[-1], array, params["axes"])


def _over_axes(
    function: Callable[[Sequence[Any]], Any], array: np.ndarray, axes: Sequence[int]
) -> np.ndarray:
    kept = [axis for axis in range(array.ndim) if axis not in axes]
    shape, reduced = ([array.shape[axis] for axis in each] for each in (kept, axes))
    rows = array.transpose([*kept, *axes]).reshape(int(np.prod(shape)), int(np.prod(reduced)))
    return objects(shape, (function(list(row)) for row in rows))


def _folded(function: Callable[[Any, Any], Any], row: Sequence[Any]) -> list[Any]:
    results = [row[0]]
    for entry in row[1:]:
        results.append(function(results[-1], entry))
    return results


def _cumulative(function: Callable[[Any, Any], Any]) -> Callable[..., np.ndarray]:
    def rule(params: Params, array: np.ndarray) -> np.ndarray:
        turned = np.moveaxis(array, params["axis"], -1)
        backwards = slice(None, None, -1 if params["reverse"] else 1)
        rows = turned[..., backwards].reshape(-1, turned.shape[-1])
        entries = (entry for row in rows for entry in _folded(function, list(row)))
        return np.moveaxis(objects(turned.shape, entries)[..., backwards], -1, params["axis"])

    return rule


def _dot_general(params: Params, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    (contract_a, contract_b), (batch_a, batch_b) = params["dimension_numbers"]
    rest_a = [i for i in range(a.ndim) if i not in (*contract_a, *batch_a)]
    rest_b = [i for i in range(b.ndim) if i not in (*contract_b, *batch_b)]
    batch, m, n = (
        [array.shape[i] for i in axes] for array, axes in ((a, batch_a), (a, rest_a), (b, rest_b))
    )
    size = int(np.prod([a.shape[i] for i in contract_a]))
    left = a.transpose([*batch_a, *rest_a, *contract_a])
    right = b.transpose([*batch_b, *rest_b, *contract_b])
    left = left.reshape(int(np.prod(batch)), int(np.prod(m)), size)
    right = right.reshape(int(np.prod(batch)), int(np.prod(n)), size)
    entries = (
        total([multiply(p, q) for p, q in zip(u, v, strict=True)])
        for rows, columns in zip(left, right, strict=True)
        for u in rows
        for v in columns
    )
    return objects([*batch, *m, *n], entries)


def _tridiagonal_solve(
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


RULES: dict[str, Callable[..., np.ndarray]] = {
    **{name: _on_each(function) for name, function in (OF_ONE | OF_TWO).items()},
    "integer_pow": _integer_power,
    "reduce_sum": _reduce_sum,
    "reduce_prod": _reduce_product,
    "cumsum": _cumulative(add),
    "cumprod": _cumulative(multiply),
    "dot_general": _dot_general,
    "tridiagonal_solve": _tridiagonal_solve,
}


def scatter_add(
    equation: Any, array: np.ndarray, indices: np.ndarray, updates: np.ndarray
) -> np.ndarray:
    """The updates added in their places, which show when they are sent one at a time."""
    empty = np.zeros(array.shape)

    def place(update: Any) -> Any:
        return bind(equation, [empty, indices, update])[0]

    units = np.eye(updates.size).reshape(updates.size, *updates.shape)
    hits = np.asarray(jax.vmap(place)(units)).reshape(updates.size, -1)
    entries = list(array.flat)
    for update, hit in zip(updates.flat, hits, strict=True):
        for at in np.flatnonzero(hit):
            entries[at] = add(entries[at], update)
    return objects(array.shape, entries)


# Primitives whose result is the choice.
STEPS = {"sign", "floor", "ceil", "round"}


def by_choice(name: str, choice: np.ndarray, inputs: Sequence[np.ndarray], bits: int) -> np.ndarray:
    """The result of one of `CHOICES` or `STEPS`, for a fixed choice."""
    if name in STEPS:
        return constants(choice, bits)
    return _each(CHOICES[name], np.asarray(choice), *inputs)
