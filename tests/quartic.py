"""A problem that diverges in a plane, with a name that is hostile to every format."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np

from ropeode.problems.problem import Problem

HOSTILE = "<b>a|b</b> 100% & $x_1$ \\ {#}"


def acceleration(t, x, v, args):
    return -100 * x**3


def energy(t, y, args):
    x, v = y
    return jnp.sum(v**2 / 2 + 25 * x**4)


QUARTIC = Problem.second_order(
    acceleration,
    [[1.0, 0.5]],
    [[0.0, 0.0]],
    np.arange(8.0),
    energy=energy,
    name=HOSTILE,
)
