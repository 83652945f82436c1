"""What primitives of JAX are on heyoka's expressions and on exact constants.

An array is a NumPy array of objects, each of which is a constant (a `heyoka.real` with guard
bits) or an expression that depends on the state or the time, or a `Complex` of these.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ropeode.references.extended import linear_algebra
from ropeode.references.extended.entries import (
    CHOICES,
    CHOICES_COMPLEX,
    OF_ONE,
    OF_TWO,
    add,
    constants,
    each,
    exp,
    horner,
    multiply,
    objects,
    total,
    whole_power,
)
from ropeode.references.extended.jaxprs import bind, is_complex, refuse

Params = Mapping[str, Any]

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


def moved(equation: Any, inputs: Sequence[np.ndarray], bits: int) -> list[np.ndarray]:
    """The results of one of `MOVES`, by sending numbered places through it.

    Arguments:
        equation: of a jaxpr.
        inputs: arrays of objects, and of plain numbers (indices and the like).
        bits: of constants.
    """
    places: list[np.ndarray] = []
    entries: list[Any] = []
    for array in inputs:
        start = len(entries)
        if array.dtype == object:
            entries.extend(array.flat)
            array = np.arange(start, len(entries), dtype=np.float64).reshape(array.shape)
        places.append(array)
    params = equation.params
    filled = params.get("fill_value")
    if filled is not None:
        # Outside the array is a place that does not exist, whatever number is put there.
        params = {**params, "fill_value": np.nan}
        filled = constants(filled, bits).flat[0]
    results = [np.asarray(result) for result in bind(equation, places, params)]
    if filled is None and not all(np.all(np.isfinite(result)) for result in results):
        refuse(equation.primitive.name, " with an index outside the array")
    return [
        objects(
            result.shape,
            (entries[int(place)] if np.isfinite(place) else filled for place in result.flat),
        )
        for result in results
    ]


def on_each(function: Callable[..., Any]) -> Callable[..., np.ndarray]:
    """A function of numbers as a rule of a primitive."""
    return lambda params, *arrays: each(function, *arrays)


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


def _product(row: Sequence[Any]) -> Any:
    return _folded(multiply, row)[-1]


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


def _log_cumulative(params: Params, array: np.ndarray) -> np.ndarray:
    return each(OF_ONE["log"], _cumulative(add)(params, each(exp, array)))


def _reduce_precision(params: Params, array: np.ndarray) -> np.ndarray:
    if params["exponent_bits"] < 11 or params["mantissa_bits"] < 52:
        refuse("reduce_precision", " to fewer bits")
    return array


RULES: dict[str, Callable[..., np.ndarray]] = {
    **{name: on_each(function) for name, function in (OF_ONE | OF_TWO).items()},
    "integer_pow": lambda params, base: each(lambda z: whole_power(z, params["y"]), base),
    "reduce_sum": lambda params, array: _over_axes(total, array, params["axes"]),
    "reduce_prod": lambda params, array: _over_axes(_product, array, params["axes"]),
    "polynomial": on_each(horner),
    "reduce_precision": _reduce_precision,
    "cumsum": _cumulative(add),
    "cumprod": _cumulative(multiply),
    "cumlogsumexp": _log_cumulative,
    "dot_general": _dot_general,
    "tridiagonal_solve": linear_algebra.tridiagonal_solve,
    "triangular_solve": linear_algebra.triangular_solve,
    "cholesky": linear_algebra.cholesky,
    "fft": linear_algebra.fourier,
}


def convolution(equation: Any, array: np.ndarray, kernel: np.ndarray) -> np.ndarray:
    """A convolution: what each number of the kernel meets shows when it is 1 and the others 0."""
    # 0 is padding.
    places = np.arange(1.0, array.size + 1).reshape(array.shape)
    units = np.eye(kernel.size).reshape(kernel.size, *kernel.shape)
    params = {**equation.params, "preferred_element_type": None}
    met = jax.jit(jax.vmap(lambda unit: bind(equation, [places, unit], params)[0]))(units)
    met = np.rint(np.asarray(met)).astype(int)
    results = (
        total(
            [
                multiply(array.flat[place - 1], factor)
                for place, factor in zip(column, kernel.flat, strict=True)
                if place
            ]
        )
        for column in met.reshape(kernel.size, -1).T
    )
    return objects(met.shape[1:], results)


# What updates do to the numbers in their places, and the update that changes nothing.
SCATTERED: dict[str, tuple[Callable[[Any, Any], Any], float]] = {
    "scatter-add": (add, 0.0),
    "scatter-mul": (multiply, 1.0),
}


def scattered(
    equation: Any, array: np.ndarray, indices: np.ndarray, updates: np.ndarray
) -> np.ndarray:
    """The updates applied in their places, which show when they are sent one at a time."""
    update_by, nothing = SCATTERED[equation.primitive.name]
    before = np.full(array.shape, nothing)

    def place(update: Any) -> Any:
        return bind(equation, [before, indices, update])[0]

    single = nothing + np.eye(updates.size).reshape(updates.size, *updates.shape)
    after = np.asarray(jax.vmap(place)(single)).reshape(updates.size, -1)
    entries = list(array.flat)
    for update, changed in zip(updates.flat, after != nothing, strict=True):
        for at in np.flatnonzero(changed):
            entries[at] = update_by(entries[at], update)
    return objects(array.shape, entries)


# What primitives decide by looking at numbers, and what they are once that is decided.

# Primitives whose result is the choice.
STEPS = {"sign", "floor", "ceil", "round"}
# Primitives that take numbers from places which they choose.
PLACES = {"sort", "top_k", "reduce_max", "reduce_min", "cummax", "cummin"}


def choosing(equation: Any) -> bool:
    """Whether a primitive decides something by looking at its inputs."""
    name = equation.primitive.name
    if equation.invars and is_complex(equation.invars[0]):
        return name in CHOICES_COMPLEX or name == "lu"
    return name in CHOICES or name in STEPS or name in PLACES or name == "lu"


def turns(equation: Any) -> bool:
    """Whether the choice of a primitive is a branch of an angle; see `_side`."""
    name = equation.primitive.name
    return name == "atan2" or (name in CHOICES_COMPLEX and is_complex(equation.invars[0]))


def differ(now: np.ndarray, before: np.ndarray, angles: bool) -> np.ndarray:
    """Where two choices are not the same.

    Arguments:
        now: as `chosen` has it.
        before: the other one.
        angles: whether they are branches of angles.
    """
    return (np.abs(now) == 1) & (np.sign(now) != np.sign(before)) if angles else now != before


def chosen(equation: Any, contents: Sequence[Any], results: Sequence[Any]) -> Any:
    """The choice of a primitive that makes one, as an array of JAX.

    Arguments:
        equation: of a jaxpr.
        contents: its inputs.
        results: its results.
    """
    name, params = equation.primitive.name, equation.params
    first = contents[0]
    if turns(equation) and name != "atan2":
        return _side(jnp.imag(first), jnp.real(first))
    if name in ("abs", "cbrt"):
        return first >= 0
    if name in ("max", "min"):
        return first >= contents[1]
    if name == "clamp":
        low, x, high = contents
        return (x >= low).astype(int) + (x > high)
    if name == "rem":
        return jnp.round((first - results[0]) / contents[1])
    if name == "atan2":
        return _side(first, contents[1])
    if name == "lu":
        return results[2]
    if name == "top_k":
        return results[1]
    if name == "sort":
        along = jnp.broadcast_to(
            jnp.arange(first.shape[params["dimension"]]).reshape(
                [-1 if axis == params["dimension"] else 1 for axis in range(first.ndim)]
            ),
            first.shape,
        )
        return bind(equation, [*contents, along])[-1]
    if name in ("reduce_max", "reduce_min"):
        find = jnp.argmax if name == "reduce_max" else jnp.argmin
        return find(_in_rows(first, params["axes"]), axis=-1)
    if name in ("cummax", "cummin"):
        return _leaders(first, name == "cummax", params)
    return results[0]


def by_choice(
    equation: Any, choice: np.ndarray, inputs: Sequence[np.ndarray], bits: int
) -> list[np.ndarray]:
    """The floating-point results of a primitive on arrays of objects, for a fixed choice.

    Arguments:
        equation: of a jaxpr.
        choice: as `chosen` has it.
        inputs: arrays of objects; those of plain numbers are left out.
        bits: of constants.
    """
    name, params = equation.primitive.name, equation.params
    if name in CHOICES_COMPLEX:
        return [each(CHOICES_COMPLEX[name], choice, *inputs)]
    if name in CHOICES:
        return [each(CHOICES[name], choice, *inputs)]
    if name in STEPS:
        return [constants(choice, bits)]
    if name == "lu":
        return [linear_algebra.eliminated(inputs[0], choice)]
    if name in ("reduce_max", "reduce_min"):
        rows = _in_rows(inputs[0], params["axes"])
        return [np.take_along_axis(rows, choice[..., None], -1)[..., 0]]
    axis = params["dimension"] if name == "sort" else params["axis"]
    return [np.take_along_axis(array, choice, axis) for array in inputs]


def _in_rows(array: Any, axes: Sequence[int]) -> Any:
    """The array with some axes joined to one, the last."""
    kept = [axis for axis in range(array.ndim) if axis not in axes]
    shape = [array.shape[axis] for axis in kept]
    return array.transpose([*kept, *axes]).reshape([*shape, -1])


def _side(y: Any, x: Any) -> Any:
    """Where a point is: > 0 above the x axis and < 0 below, 1 left of the y axis and 2 right.

    An angle is followed from the half plane in which it begins to all places but the left quarter
    of the other one, which is beyond its jump.
    """
    return jnp.where(y >= 0, 1, -1) * jnp.where(x < 0, 1, 2)


def _leaders(array: Any, largest: bool, params: Any) -> Any:
    """For each place the first of the numbers up to there that is largest, or smallest."""
    axis, size = params["axis"], array.shape[params["axis"]]
    rows = jnp.moveaxis(array, axis, -1)[..., None, :]
    upto = jnp.tri(size, dtype=bool)
    upto = upto.T if params["reverse"] else upto
    worst = -jnp.inf if largest else jnp.inf
    find = jnp.argmax if largest else jnp.argmin
    return jnp.moveaxis(find(jnp.where(upto, rows, worst), axis=-1), -1, axis)
