"""The functions of a problem: those of the library as they are, those of the user traced."""

from __future__ import annotations

import functools
import types
from collections.abc import Callable
from typing import Any

import jax
import numpy as np

from ropeode import cache
from ropeode.cache import Source, described
from ropeode.problems.traced import Traced


def traced(name: str, function: Callable, inputs: tuple) -> Callable:
    """A user's function traced, unless it is already; one of the library's own as it is.

    Arguments:
        name, function, inputs: as for `Traced`, which raises what its arguments are to blame for.
    """
    if _never_changes(function) or (isinstance(function, Traced) and function.fits(inputs)):
        return function
    return Traced(name, getattr(function, "function", function), inputs)


@functools.lru_cache(maxsize=64)
def compiled(function: Callable) -> Callable:
    """A function compiled by JAX, once for all that are equal."""
    return jax.jit(function)


@functools.lru_cache(maxsize=64)
def for_each_state(function: Callable) -> Callable:
    """``function(t, y, args)``, compiled for many times and states at once."""
    return jax.jit(jax.vmap(function, in_axes=(0, 0, None)))


def evaluated_once(function: Callable, *inputs: Any) -> Any:
    """The array that a function returns.

    Commands find the programs of the library's functions in their cache folder, and trace nothing.
    """
    leaves, tree = jax.tree.flatten(inputs)
    shapes = tuple(jax.ShapeDtypeStruct(np.shape(leaf), np.result_type(leaf)) for leaf in leaves)
    kept = _kept(function, tree, shapes) if cache.is_used() else None
    return compiled(function)(*inputs) if kept is None else kept(*inputs)[0]


@functools.lru_cache(maxsize=64)
def _kept(function: Callable, tree: Any, leaves: tuple) -> Callable | None:
    inputs = jax.tree.unflatten(tree, leaves)
    try:
        description = described(("value", function, inputs))
    except TypeError:
        return None
    return cache.program(description, lambda: Source(function, inputs))[0]


def _never_changes(function: Callable) -> bool:
    """Whether it is a function or an object of the library, with nothing of the user's in it."""
    if isinstance(function, types.FunctionType):
        # Code that was run by `exec` has no module.
        own = (function.__module__ or "").startswith("ropeode.")
        return own and function.__closure__ is None
    return type(function).__module__.startswith("ropeode.") and not isinstance(function, Traced)
