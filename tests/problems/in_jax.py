"""Functions of JAX, called as NumPy calls a function."""

from __future__ import annotations

import functools

import jax
import numpy as np

_compiled = functools.cache(jax.jit)


def in_jax(function, *inputs):
    """What a function returns in float64, as arrays of NumPy; it is compiled once."""
    with jax.enable_x64(True):
        return jax.tree.map(np.asarray, _compiled(function)(*inputs))
