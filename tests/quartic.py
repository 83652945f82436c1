"""A problem that diverges in a plane, with a name that is hostile to every format."""

from __future__ import annotations

import functools

import jax.numpy as jnp
import numpy as np

from ropeode.problems import Problem

HOSTILE = "<b>a|b</b> 100% & $x_1$ \\ {#}"


def acceleration(t, x, v, args):
    return -100 * x**3


def energy(t, y, args):
    x, v = y
    return jnp.sum(v**2 / 2 + 25 * x**4)


@functools.cache
def quartic() -> Problem:
    """Built when it is needed: JAX starts with the first problem, and must be set up before."""
    x0, v0 = [[1.0, 0.5]], [[0.0, 0.0]]
    return Problem.second_order(acceleration, x0, v0, np.arange(8.0), energy=energy, name=HOSTILE)
