"""A damped pendulum: ropeode table --problem pendulum.py:pendulum."""

import jax.numpy as jnp
import numpy as np

from ropeode import LinearDamping, Problem

RATE = 0.1


def acceleration(t, x, v, args):
    """Gravity and damping, for an angle `x`."""
    return -jnp.sin(x) - RATE * v


def pendulum(frames=20):
    """Released at rest, 2 radians from hanging down."""
    return Problem.second_order(
        acceleration,
        x0=[2.0],
        v0=[0.0],
        ts=np.arange(frames + 1.0),
        damping=lambda args: LinearDamping(rate=RATE, coefficient=RATE),
        name="pendulum",
    )
