"""What primitives decide by looking at numbers, and what they are once that is decided."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np

from ropeode.references.extended.arrays import constants, each
from ropeode.references.extended.entries import CHOICES, CHOICES_COMPLEX
from ropeode.references.extended.jaxprs import bind, is_complex
from ropeode.references.extended.linear_algebra import eliminated

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
        return [eliminated(inputs[0], choice)]
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
