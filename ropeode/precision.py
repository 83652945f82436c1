"""float64 for the length of a call, whatever the caller's JAX configuration is."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import ParamSpec, TypeVar

import jax

from ropeode import callbacks

P = ParamSpec("P")
R = TypeVar("R")


def in_float64(function: Callable[P, R]) -> Callable[P, R]:
    """Make a public function run with 64-bit JAX types.

    The switch is made outside any ``jit`` (inside one it breaks diffrax), and functions
    decorated with it must return NumPy arrays: a float64 JAX array that leaves the scope
    turns into float32 at the caller's next operation. What Python code inside a compiled
    program raised meanwhile is raised at the end.
    """

    @functools.wraps(function)
    def wrapper(*args: P.args, **kwargs: P.kwargs) -> R:
        with jax.enable_x64(True), callbacks.raised_again():
            return function(*args, **kwargs)

    return wrapper
