"""Checks of the arguments of a problem."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import jax
import numpy as np

from ropeode.arrays import float64_only, real_array
from ropeode.errors import RopeodeError, UserCodeError
from ropeode.precision import in_float64
from ropeode.problems.functions import compiled, traced
from ropeode.problems.signatures import check_signature
from ropeode.problems.traced import Traced
from ropeode.validation import bad_value, finite_numbers, not_traced, shortly

# Where else a function with other parameters, or in NumPy, may belong.
_OTHERS = {"rhs": ", or use Problem.from_scipy(rhs, ts, y0), which takes rhs(t, y, *args) in NumPy"}
_IN_NUMPY = {"rhs": "; or hand rhs(t, y, *args) to Problem.from_scipy, which takes NumPy"}


def sample_times(value: Any) -> np.ndarray:
    """`value` as a new float64 array of at least two increasing times.

    Raises:
        InputError: it is not.
    """
    ts = real_array("ts", value, "[0, 1, 2]")
    if ts.ndim != 1 or len(ts) < 2:
        raise bad_value("ts", value, "at least two sample times", "for example ts = [0, 1, 2]")
    later = ts[1:] > ts[:-1]
    if not np.all(later):
        i = int(np.argmin(later))
        raise bad_value(
            "ts",
            ts[i : i + 2].tolist(),
            "increasing sample times",
            f"sort them and drop repeats; entries {i} and {i + 1} are out of order",
        )
    if ts[-1] / 2 - ts[0] / 2 > np.finfo(np.float64).max / 2:
        fix = "choose another unit of time"
        raise bad_value("ts", value, "a span that is a number in float64", fix)
    return ts


def jump_times(value: Sequence[float], ts: np.ndarray) -> tuple[float, ...]:
    """Jump times as an increasing tuple inside the sample times' span.

    Raises:
        InputError: one of them lies outside, or they do not increase.
    """
    try:
        times = finite_numbers(value)
    except ValueError as error:
        raise bad_value(
            "jump_times", value, f"a list of times ({error})", "for example [2.5]"
        ) from None
    if any(not ts[0] < time < ts[-1] for time in times) or list(times) != sorted(set(times)):
        raise bad_value(
            "jump_times",
            times,
            f"increasing times inside ({ts[0]}, {ts[-1]})",
            "sort them and leave out those outside",
        )
    return times


def callable_or_none(name: str, value: Any) -> None:
    """Raises:
    InputError: `value` is neither None nor a function.
    """
    if value is not None and not callable(value):
        raise bad_value(name, value, "a function", "give a function or leave it out")


def name_and_parameters(name: Any, parameters: Any) -> None:
    """Raises:
    InputError: they are no text, or no mapping.
    """
    if not isinstance(name, str):
        raise bad_value("name", name, "a text", 'for example name="pendulum"')
    if not isinstance(parameters, Mapping):
        raise bad_value("parameters", parameters, "a dict", "for example {'strength': 1.3}")


def numeric_pytree(name: str, value: Any) -> Any:
    """`value` with its leaves as float64 (or integer, or boolean) arrays.

    Raises:
        InputError: a leaf is not numeric.
    """

    def leaf(path: Any, entry: Any) -> np.ndarray:
        not_traced(name + jax.tree_util.keystr(path), entry)
        array = np.asarray(entry)
        float64_only(name + jax.tree_util.keystr(path), array)
        if array.dtype.kind == "f":
            return array.astype(np.float64)
        if array.dtype.kind in "iub":
            return array.copy()
        raise bad_value(name, entry, "numbers and arrays of numbers", "bind the rest into the rhs")

    return jax.tree_util.tree_map_with_path(leaf, value)


@in_float64
def right_hand_side(rhs: Any, t: np.float64, y: np.ndarray, args: Any) -> Callable:
    """Trace a right-hand side, and try it on the initial state.

    Raises:
        InputError: it is not a function, or its result has the wrong shape or dtype or is
            not finite.
        UserCodeError: it raised.
    """
    return _tried("rhs", "rhs(t, y, args)", rhs, y, (t, y, args))


@in_float64
def acceleration(function: Any, t: np.float64, x: np.ndarray, v: np.ndarray, args: Any) -> Callable:
    """Trace an acceleration, and try it on the initial state; raises as `right_hand_side` does.

    `Problem.second_order` calls the same compiled function with other velocities.
    """
    return _tried("acceleration", "acceleration(t, x, v, args)", function, x, (t, x, v, args))


def _tried(name: str, signature: str, function: Any, like: np.ndarray, inputs: tuple) -> Callable:
    function, result = _traced(name, signature, function, inputs, _evaluated)
    if getattr(result, "shape", None) != like.shape:
        what = getattr(result, "shape", type(result).__name__)
        raise bad_value(
            f"{name} result",
            what,
            f"one array of the state's shape, {like.shape}",
            f"return such an array from {signature}, for example with jnp.stack",
        )
    if result.dtype != np.float64:
        raise bad_value(
            f"{name} result",
            str(result.dtype),
            "float64",
            "remove casts and 32-bit constants; compute with the dtype of the arguments",
        )
    shape_alone = isinstance(result, jax.ShapeDtypeStruct)
    value = np.asarray(_evaluated(function, *inputs) if shape_alone else result)
    if not np.all(np.isfinite(value)):
        raise bad_value(
            f"{name} result",
            value,
            "finite numbers at the initial state",
            "start where the right-hand side is defined",
        )
    return function


@in_float64
def energy(function: Any, t: np.float64, y: np.ndarray, args: Any) -> Callable:
    """Trace an energy at the initial state.

    Raises:
        InputError: it is not a function of the right arguments.
        UserCodeError: the function raised.
    """
    return _traced("energy", "energy(t, y, args)", function, (t, y, args))[0]


@in_float64
def constraints(
    function: Any, t: np.float64, y: np.ndarray, args: Any, quantities: Any
) -> Callable:
    """Trace constraints at the initial state.

    Raises:
        InputError: they are not a function, or do not return residuals by quantity.
        UserCodeError: the function raised.
    """
    signature = "constraints(t, y, args)"
    function, residuals = _traced("constraints", signature, function, (t, y, args), jax.eval_shape)
    if not isinstance(residuals, Mapping) or not set(residuals) <= set(quantities):
        raise bad_value(
            "constraints result",
            residuals,
            f"a dict with keys among {', '.join(quantities)}",
            "name each residual by the quantity that has its units",
        )
    return function


@in_float64
def damping(function: Any, args: Any) -> Callable:
    """Trace the damping of an acceleration.

    Raises:
        InputError: it is not a function.
        UserCodeError: the function raised.
    """
    return _traced("damping", "damping(args)", function, (args,), _called)[0]


@in_float64
def links(function: Any, x: np.ndarray, node_axis: int, args: Any) -> Callable:
    """Trace links, and try them on the initial positions.

    Raises:
        InputError: they are not a function, the positions are not ``(dim, nodes)``, or there
            is not one length for each pair of neighbours.
        UserCodeError: the function raised.
    """
    function, result = _traced("links", "links(args)", function, (args,), _called)
    if x.ndim != 2 or node_axis != 1:
        raise bad_value(
            "links",
            f"positions {x.shape} with nodes along axis {node_axis}",
            "positions (dim, nodes) with node_axis=1",
            "transpose them",
        )
    if getattr(getattr(result, "length", None), "shape", None) != (x.shape[1] - 1,):
        raise bad_value(
            "links result",
            result,
            f"Links with {x.shape[1] - 1} lengths",
            "give one length for each pair of neighbours",
        )
    return function


def _evaluated(function: Callable, *inputs: Any) -> Any:
    return compiled(function)(*inputs)


def _called(function: Callable, *inputs: Any) -> Any:
    return function(*inputs)


def _traced(
    name: str,
    signature: str,
    function: Any,
    inputs: tuple,
    evaluated: Callable[..., Any] = lambda *_: None,
) -> tuple[Callable, Any]:
    """A function in JAX, and its result: shapes and dtypes, where it is the user's.

    Arguments:
        name, signature, function, inputs: of the function.
        evaluated: the result of a function of the library, which need not be traced for it.
    """
    if not callable(function):
        raise bad_value(name, function, f"a function {signature}", "write one in JAX")
    wanted = signature.partition("(")[2].rstrip(")").split(", ")
    check_signature(name, function, wanted, _OTHERS.get(name, ""))
    try:
        function = traced(name, function, inputs)
        if isinstance(function, Traced):
            return function, function.result
        return function, evaluated(function, *inputs)
    except RopeodeError:
        raise
    except Exception as error:
        raise UserCodeError(
            f"{name}: raised {shortly(error)} when it was tried on the initial state; "
            f"allowed: a function {signature} in JAX. Fix: correct the error above; use "
            f"jax.numpy, and no Python `if` on values{_IN_NUMPY.get(name, '')}."
        ) from error
