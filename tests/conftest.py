"""Fixtures that several rooms share."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import settings

from ropeode.problems.links import LinearDamping
from ropeode.problems.problem import Problem
from ropeode.problems.rope import Rope

# The gate draws the same examples each time; `pytest --hypothesis-profile=random` searches on.
settings.register_profile("repeatable", derandomize=True)
settings.register_profile("random", derandomize=False)
settings.load_profile("repeatable")


@pytest.fixture(scope="session")
def small_rope() -> Problem:
    """A rope that computes in no time."""
    return Rope(num_nodes=4).problem(frames=3)


def pendulum_acceleration(t, x, v, args):
    """A pendulum driven by a force that depends on time, with damping."""
    return -jnp.sin(x) + 0.3 * jnp.cos(1.3 * t) - args["rate"] * v


def pendulum_damping(args):
    return LinearDamping(args["rate"], args["rate"])


@pytest.fixture(scope="session")
def driven_pendulum() -> Problem:
    """Non-autonomous, nonlinear, damped, moving at the start; frames of length 0.7."""
    return Problem.second_order(
        pendulum_acceleration,
        [[0.4]],
        [[1.1]],
        2.0 + 0.7 * np.arange(8),
        {"rate": 0.2},
        damping=pendulum_damping,
        name="driven pendulum",
    )
