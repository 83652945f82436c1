"""float64 on the processor for the length of a call, whatever the caller's JAX configuration is."""

from __future__ import annotations

import contextlib
import functools
import warnings
from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar

import jax
import jax.numpy as jnp
import numpy as np

from ropeode import callbacks, lapack  # noqa: F401  (for what it does to JAX)
from ropeode.validation import bad_value, is_traced, traced_value

_FLOAT32 = (
    "JAX computes this right-hand side in float32, because its float64 mode is off where jit, grad "
    "or vmap trace it; everything that ropeode says of the problem is about float64. Before you "
    "trace, call jax.config.update('jax_enable_x64', True), or hand problem.to_scipy() to SciPy"
)

_TRACER_ERRORS = (
    jax.errors.ConcretizationTypeError,
    jax.errors.TracerArrayConversionError,
    jax.errors.TracerIntegerConversionError,
)

P = ParamSpec("P")
R = TypeVar("R")


def in_float64(function: Callable[P, R]) -> Callable[P, R]:
    """Make a public function run with 64-bit JAX types, on the processor.

    The switch is made outside any ``jit`` (inside one it breaks diffrax), and functions
    decorated with it must return NumPy arrays: a float64 JAX array that leaves the scope
    turns into float32 at the caller's next operation. What Python code inside a compiled
    program raised meanwhile is raised at the end.
    """

    @functools.wraps(function)
    def wrapper(*args: P.args, **kwargs: P.kwargs) -> R:
        _check_settings()
        with jax.enable_x64(True), on_processor(), callbacks.raised_again():
            try:
                return function(*args, **kwargs)
            except _TRACER_ERRORS:
                # Inside a user's own `jit` even the sum of two numbers is traced.
                inside = is_traced(jnp.add(0, 0))
                if not inside and not is_traced((args, kwargs)):
                    raise
                raise traced_value(getattr(function, "__name__", "ropeode"), "a call") from None

    return wrapper


def on_processor() -> contextlib.AbstractContextManager[Any]:
    """A block in which JAX computes on the processor, unless the user names another device.

    A step of a small system takes a processor less time than a GPU takes to begin it: where JAX
    finds a GPU, a table of seconds would take minutes.
    """
    config = jax.config
    named = config.jax_platforms or config.jax_default_device is not None  # type: ignore[attr-defined]
    if named or jax.default_backend() == "cpu":
        return contextlib.nullcontext()
    return jax.default_device(jax.devices("cpu")[0])


def _check_settings() -> None:
    """Refuse settings of JAX under which nothing can be computed; another error would be blamed."""
    if jax.config.jax_disable_jit:  # type: ignore[attr-defined]
        allowed = "unset, since ropeode compiles what it runs"
        raise bad_value("JAX_DISABLE_JIT", True, allowed, "unset it, and leave jax.disable_jit()")
    _find_devices()


@functools.cache
def _find_devices() -> None:
    try:
        jax.devices()
    except RuntimeError as error:
        given = jax.config.jax_platforms  # type: ignore[attr-defined]
        allowed = f"a platform that JAX finds here ({error})"
        raise bad_value("JAX_PLATFORMS", given, allowed, "unset it") from None


def rhs_in_float64(rhs: Callable[..., Any], *inputs: Any) -> Any:
    """A right-hand side in JAX at these inputs, whoever calls it.

    Outside of JAX's float64 mode the result is a NumPy array in float64, as that of every public
    function. Where JAX traces the call, it is too late for that; then it warns.

    Arguments:
        rhs: ``rhs(t, y, args)``.
        inputs: time, state and arguments.
    """
    if jax.config.jax_enable_x64:  # type: ignore[attr-defined]
        return rhs(*inputs)
    if is_traced(inputs):
        warnings.warn(_FLOAT32, stacklevel=4)
        return rhs(*inputs)
    return jax.tree.map(np.asarray, in_float64(rhs)(*inputs))
