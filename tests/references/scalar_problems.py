"""Equations for one number, of which all share one compiled program.

Compiling takes longer than all runs of a reference. So the equation is an input of the right-hand
side, and all problems have six samples.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from ropeode.problems import Problem

SAMPLES = 6


def _pulse(t, y, width, height=0.5):
    return 1.0 - y + height * jnp.exp(-(((t - 3.3) / width) ** 2))


EQUATIONS = {
    "decay": lambda t, y, rate: -rate * y,
    "logistic": lambda t, y, number: y * (1 - y),
    "square": lambda t, y, rate: rate * y * y,
    "root": lambda t, y, rate: rate * jnp.sqrt(jnp.abs(y)),
    "tank": lambda t, y, rate: rate * jnp.sqrt(jnp.maximum(y, 0.0)),
    "root of what is left": lambda t, y, number: jnp.sqrt(1.0 - t) + 0.0 * y,
    # The state rounded to the 24 bits of a float32, by Veltkamp's splitting.
    "24 bits": lambda t, y, rate: -rate * ((2.0**29 + 1) * y - ((2.0**29 + 1) * y - y)),
    "pulse": _pulse,
    # Its area is 1, however narrow it is.
    "tall pulse": lambda t, y, width: _pulse(t, y, width, 1.0 / (width * jnp.sqrt(jnp.pi))),
    "turns": lambda t, y, at: jnp.where(t <= at, y, -y),
    # sin t, from 0 on: stiff where the rate is far below zero, unstable where it is above.
    "follows": lambda t, y, rate: rate * (y - jnp.sin(t)) + jnp.cos(t),
}


def rhs(t, y, args):
    which, number = args
    return jax.lax.switch(which, list(EQUATIONS.values()), t, y, number)


def scalar(name, y0, ts, number=1.0, **more) -> Problem:
    """The problem of one of `EQUATIONS` from one number on."""
    assert len(ts) == SAMPLES
    args = (np.int64(list(EQUATIONS).index(name)), float(number))
    return Problem(rhs, [y0], ts, args, **{"name": name, **more})
