"""float64: for the length of a call, or in a process that is all ours."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import ParamSpec, TypeVar

import jax
import platformdirs

P = ParamSpec("P")
R = TypeVar("R")


def in_float64(function: Callable[P, R]) -> Callable[P, R]:
    """Make a public function run with 64-bit JAX types.

    The switch is made outside any ``jit`` (inside one it breaks diffrax), and functions
    decorated with it must return NumPy arrays: a float64 JAX array that leaves the scope
    turns into float32 at the caller's next operation.
    """

    @functools.wraps(function)
    def wrapper(*args: P.args, **kwargs: P.kwargs) -> R:
        with jax.enable_x64(True):
            return function(*args, **kwargs)

    return wrapper


def set_up_jax() -> None:
    """Use 64-bit types, and a compilation cache in the user's cache folder, in all of a process."""
    jax.config.update("jax_enable_x64", True)
    jax.config.update(
        "jax_compilation_cache_dir", str(platformdirs.user_cache_path("ropeode") / "compiled")
    )
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)
