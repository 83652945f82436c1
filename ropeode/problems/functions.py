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


@functools.lru_cache(maxsize=256)
def compiled(function: Callable, *of: Any) -> Callable:
    """A function compiled by JAX, or what it makes of others, once for all that are equal.

    Commands find the programs of the library's functions in their cache folder, and trace nothing.

    Arguments:
        function: returns an array, or arrays in a tuple or by names.
        of: if any are given, `function` makes of these what is compiled.

    Returns:
        It takes what the compiled function takes.
    """
    own = function(*of) if of else function
    jitted = jax.jit(own)
    programs: dict[tuple, Callable] = {}

    def call(*inputs: Any) -> Any:
        if not cache.is_used():
            return jitted(*inputs)
        leaves, tree = jax.tree.flatten(inputs)
        shapes = tuple(
            jax.ShapeDtypeStruct(np.shape(leaf), np.result_type(leaf)) for leaf in leaves
        )
        key = tree, shapes, jax.config.jax_enable_x64  # type: ignore[attr-defined]
        if key not in programs:
            like = tree.unflatten(shapes)
            description = described(("value", function, of, like))
            # What is the user's is not kept.
            programs[key] = jitted if description is None else _kept(description, own, like)
        return programs[key](*inputs)

    return call


def _kept(description: str, function: Callable, inputs: tuple) -> Callable:
    """The program in the cache folder, whose result has the form of the function's."""

    def source() -> Source:
        form = jax.tree.map(lambda _: 0, jax.eval_shape(function, *inputs))
        return Source(function, inputs, form)

    run, form = cache.program(description, source)
    # JSON knows no tuples.
    result = jax.tree.structure(tuple(form) if isinstance(form, list) else form)
    return lambda *inputs: result.unflatten(run(*inputs))


def for_each_state(function: Callable) -> Callable:
    """``function(t, y, args)``, compiled for many times and states at once."""
    return compiled(_for_each_state, function)


def _for_each_state(function: Callable) -> Callable:
    return jax.vmap(function, in_axes=(0, 0, None))


def _never_changes(function: Callable) -> bool:
    """Whether it is a function or an object of the library, with nothing of the user's in it."""
    if isinstance(function, types.FunctionType):
        # Code that was run by `exec` has no module.
        own = (function.__module__ or "").startswith("ropeode.")
        return own and function.__closure__ is None
    return type(function).__module__.startswith("ropeode.") and not isinstance(function, Traced)
