"""A user's function as JAX sees it when a problem is made."""

from __future__ import annotations

import contextlib
import hashlib
import os
from collections.abc import Callable, Iterator
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.extend.core import ClosedJaxpr, Jaxpr, JaxprEqn, Literal, jaxpr_as_fun

from ropeode.precision import in_float64, rhs_in_float64
from ropeode.problems.memory import TOO_COARSE
from ropeode.problems.nested_jaxprs import equations, evaluated
from ropeode.validation import bad_value

# A function with a derivative of its own for reverse mode; it has none for forward mode.
_OWN_REVERSE = "custom_vjp_call"
# Calls of Python that may convert their arrays in threads of XLA, where float64 mode is off.
_CALLBACKS = ("pure_callback", "io_callback")
# Their functions are there for derivatives, and say nothing of the values.
_WITH_DERIVATIVES = ("custom_jvp_call", "custom_vjp_call", "custom_vjp_call_jaxpr")
# A float32 has 24 bits. A number with so few as this may well be what was meant.
_PLAIN_BITS = 16
_OWN = os.path.dirname(os.path.dirname(__file__)) + os.sep


class Traced:
    """A function in JAX: the operations that it consists of, and the numbers in them.

    It never changes: what the function reads besides its arguments (a closure, a global variable,
    an attribute) is read once, when it is traced. Two are equal if they compute the same. So
    compiled programs are kept by it, and cannot be out of date.

    Arguments:
        name: of the function, for messages.
        function: in JAX.
        inputs: for which it is traced; only their shapes and dtypes count.

    Raises:
        InputError: it computes in float32, or calls Python.
        Exception: whatever the function raises.
    """

    def __init__(self, name: str, function: Callable, inputs: tuple):
        self.name, self.function = name, function
        # Under which JAX reports what it compiles.
        self.__name__ = getattr(function, "__name__", name)
        self.inputs = jax.tree.map(
            lambda leaf: jax.ShapeDtypeStruct(np.shape(leaf), np.result_type(leaf)), inputs
        )

        # A new function at each call: JAX finds the traces of functions again.
        def called(*inputs: Any) -> Any:
            return function(*inputs)

        traced, self.result = jax.make_jaxpr(called, return_shape=True)(*self.inputs)
        # The user's own arrays may be written to later.
        constants = [np.array(c) if isinstance(c, np.ndarray) else c for c in traced.consts]
        self.jaxpr = _for_forward_mode(ClosedJaxpr(traced.jaxpr, constants))
        _refuse_callbacks(name, self.jaxpr)
        _require_float64(name, self.jaxpr)
        self._operations = jaxpr_as_fun(self.jaxpr)
        # The same numbers in other trees are inputs of another function.
        self._digest = jaxpr_digest(self.jaxpr) + str(jax.tree.structure(self.inputs))
        if any(each.primitive.name == "custom_jvp_call" for each in equations(self.jaxpr)):
            # What such a function says of its derivative is no part of its operations. Where
            # another primitive has no derivative, nobody can ask for this one.
            with contextlib.suppress(NotImplementedError, ValueError):
                self._digest += jaxpr_digest(
                    jax.make_jaxpr(self._slope)(*jax.tree.leaves(self.inputs))
                )

    def __call__(self, *inputs: Any) -> Any:
        """What the function returns; the function itself answers where other shapes are asked."""
        return rhs_in_float64(self._evaluated, *inputs)

    def _evaluated(self, *inputs: Any) -> Any:
        if not self.fits(inputs) or not jax.config.jax_enable_x64:  # type: ignore[attr-defined]
            return self.function(*inputs)
        leaves = map(_as, jax.tree.leaves(inputs), jax.tree.leaves(self.inputs))
        return jax.tree.unflatten(jax.tree.structure(self.result), self._operations(*leaves))

    def fits(self, inputs: tuple) -> bool:
        """Whether inputs have the structure and the shapes for which it was traced."""
        own, tree = jax.tree.flatten(self.inputs)
        leaves, others = jax.tree.flatten(inputs)
        return tree == others and all(
            np.shape(leaf) == one.shape for leaf, one in zip(leaves, own, strict=True)
        )

    def _slope(self, *leaves: Any) -> Any:
        """The derivative along all floating-point inputs."""
        moving = [np.issubdtype(leaf.dtype, np.floating) for leaf in leaves]
        numbers = [leaf for leaf, moves in zip(leaves, moving, strict=True) if moves]

        def of_numbers(*numbers: Any) -> Any:
            own = iter(numbers)
            both = zip(leaves, moving, strict=True)
            return self._operations(*(next(own) if moves else leaf for leaf, moves in both))

        return jax.jvp(of_numbers, numbers, numbers)[1]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Traced) and self._digest == other._digest

    def __hash__(self) -> int:
        return hash(self._digest)

    def __repr__(self) -> str:
        return repr(self.function)

    def __deepcopy__(self, memo: Any) -> Traced:
        return self

    def __reduce__(self) -> tuple:
        # The operations are those of this process; another one traces the function again.
        return _traced_again, (self.name, self.function, self.inputs)


@in_float64
def _traced_again(name: str, function: Callable, inputs: tuple) -> Traced:
    return Traced(name, function, inputs)


def _as(leaf: Any, like: jax.ShapeDtypeStruct) -> Any:
    # Not None for want of a dtype: NumPy takes that for float64.
    same = getattr(leaf, "dtype", "none") == like.dtype
    return leaf if same else jnp.asarray(leaf, like.dtype)


def _for_forward_mode(traced: ClosedJaxpr) -> ClosedJaxpr:
    """The same function, without derivatives of its own that work in reverse mode only."""
    if not any(equation.primitive.name == _OWN_REVERSE for equation in equations(traced)):
        return traced
    return jax.make_jaxpr(lambda *inputs: evaluated(traced, inputs, _entered))(*traced.in_avals)


def _entered(equation: JaxprEqn, inputs: list[Any]) -> list[Any]:
    primitive, params = equation.primitive, equation.params
    if primitive.name == _OWN_REVERSE:
        return evaluated(params["call_jaxpr"], inputs, _entered)
    inner = {name: _for_forward_mode_inside(value) for name, value in params.items()}
    results = primitive.bind(*inputs, **primitive.get_bind_params(inner))
    return results if primitive.multiple_results else [results]


def _for_forward_mode_inside(value: Any) -> Any:
    if isinstance(value, (tuple, list)):
        parts = map(_for_forward_mode_inside, value)
        # A named tuple takes its fields one by one.
        return type(value)(*parts) if hasattr(value, "_fields") else type(value)(parts)
    return _for_forward_mode(value) if isinstance(value, ClosedJaxpr) else value


def callbacks_in(traced: ClosedJaxpr) -> list[JaxprEqn]:
    """The calls of Python among a function's operations, with arrays that may lose digits."""
    return [each for each in equations(traced) if each.primitive.name in _CALLBACKS]


def _refuse_callbacks(name: str, traced: ClosedJaxpr) -> None:
    """Raises:
    InputError: it calls Python.
    """
    for equation in callbacks_in(traced):
        raise bad_value(
            name,
            _Words(f"{equation.primitive.name!r}{_place(equation)}"),
            "operations of JAX",
            "hand a function in NumPy to Problem.from_scipy(fun, ts, y0), which calls it",
        )


def _require_float64(name: str, traced: ClosedJaxpr) -> None:
    """Raises:
    InputError: a number in it has fewer digits than float64.
    """
    for variable, constant in zip(traced.jaxpr.constvars, traced.consts, strict=True):
        if str(variable.aval.dtype) in TOO_COARSE:
            raise too_coarse(name, f"the constant {np.asarray(constant)!r}")
    for equation in equations(traced):
        for variable in (*equation.invars, *equation.outvars):
            dtype = str(getattr(variable.aval, "dtype", ""))
            if dtype in TOO_COARSE:
                what = f"{equation.primitive.name!r} in {dtype}"
                raise too_coarse(name, what + _place(equation))
            if isinstance(variable, Literal) and dtype == "float64" and was_float32(variable.val):
                value = float(variable.val)
                what = f"the constant {np.float32(value)!s} in float32, which is {value!r},"
                raise too_coarse(name, what + _place(equation))


def was_float32(value: Any) -> bool:
    """Whether a float64 is a float32 that had too few digits for what was meant, such as 0.1.

    JAX widens single numbers without a trace. Such a number has no more bits than a float32, and
    more digits: 0.10000000149011612.
    """
    value = float(value)
    with np.errstate(all="ignore"):
        if not np.isfinite(value) or float(np.float32(value)) != value:
            return False
    bits = (np.frexp(value)[0] * 2.0**_PLAIN_BITS) % 1.0 != 0.0
    return bool(bits) and float(str(np.float32(value))) != value


def too_coarse(name: str, what: str) -> Exception:
    """The error that something has fewer digits than float64."""
    return bad_value(
        name,
        _Words(what),
        "numbers in float64",
        "write the number in Python or NumPy (np.array([0.1])), convert arrays before the function "
        "is made (np.asarray(table, dtype=float)), drop casts, and make arrays of JAX inside the "
        "function; outside of float64 mode they are float32",
    )


class _Words(str):
    """A text that a message shows as it is."""

    def __repr__(self) -> str:
        return str(self)


def _place(equation: JaxprEqn) -> str:
    """Where the user's code has an operation."""
    frames = getattr(equation.source_info.traceback, "frames", [])
    for frame in frames:
        if "site-packages" not in frame.file_name and not frame.file_name.startswith(_OWN):
            return f" in line {frame.line_num} of {frame.file_name}"
    return ""


def jaxpr_digest(traced: ClosedJaxpr) -> str:
    """The sha256 of all operations of a traced function, with all their numbers.

    Arguments:
        traced: by `jax.make_jaxpr`.
    """
    whole = hashlib.sha256()
    for part in _parts(traced):
        whole.update(part)
        whole.update(b"\0")
    return whole.hexdigest()


def _parts(traced: ClosedJaxpr | Jaxpr) -> Iterator[bytes]:
    if isinstance(traced, ClosedJaxpr):
        yield from map(_number, traced.consts)
        traced = traced.jaxpr
    names: dict[Any, int] = {}

    def named(variable: Any) -> bytes:
        if isinstance(variable, Literal):
            return _number(variable.val)
        return f"{names.setdefault(variable, len(names))}:{variable.aval}".encode()

    yield from map(named, (*traced.constvars, *traced.invars))
    for equation in traced.eqns:
        yield equation.primitive.name.encode()
        yield from map(named, equation.invars)
        for name, value in sorted(equation.params.items()):
            yield name.encode()
            for each in value if isinstance(value, (tuple, list)) else (value,):
                if isinstance(each, (ClosedJaxpr, Jaxpr)):
                    yield from _parts(each)
                elif isinstance(each, (np.ndarray, jax.Array)):
                    yield _number(each)
                elif not (callable(each) and equation.primitive.name in _WITH_DERIVATIVES):
                    # Of other functions, such as callbacks, nothing is known but which they are.
                    yield repr(each).encode()
        yield from map(named, equation.outvars)
    yield from map(named, traced.outvars)


def _number(value: Any) -> bytes:
    if jax.numpy.issubdtype(getattr(value, "dtype", float), jax.dtypes.prng_key):
        value = jax.random.key_data(value)
    array = np.asarray(value)
    return f"{array.dtype}{array.shape}".encode() + array.tobytes()
