"""Studies that hold all that a plot can be asked to show."""

from __future__ import annotations

import functools

import jax.numpy as jnp
import numpy as np
import pytest

from ropeode.problems.problem import Problem
from ropeode.problems.rope import Rope
from ropeode.render.plots.registry import PLOTS

HOSTILE = "<b>a|b</b> 100% & $x_1$ \\ {#}"


def quartic_acceleration(t, x, v, args):
    return -100 * x**3


def quartic_energy(t, y, args):
    x, v = y
    return jnp.sum(v**2 / 2 + 25 * x**4)


# One that diverges in a plane, with a name that is hostile to every format.
QUARTIC = Problem.second_order(
    quartic_acceleration,
    [[1.0, 0.5]],
    [[0.0, 0.0]],
    np.arange(8.0),
    energy=quartic_energy,
    name=HOSTILE,
)

# Ropes of 3 nodes over 3 frames share what is compiled.
CASES = {
    # Orders, unresolved errors, round-off and some that blow up.
    "rope": (
        Rope(num_nodes=3, damping=0.0).problem(frames=3),
        ["stormer-verlet", "rk4", "explicit-euler"],
        (4, 8, 33, 66, 132, 1000, 3000, 30000),
        {},
    ),
    "diverged": (QUARTIC, ["explicit-euler", "rk4"], (2, 512, 1024), {}),
    "long names": (
        Rope(num_nodes=3).problem(frames=3),
        ["stormer-verlet:start=rest,damping=per-step", "stormer-verlet:damping=lagged", "rk4"],
        (4, 8),
        {},
    ),
    # The reference ends before the frames do.
    "cut": (
        Rope(num_nodes=4, damping=0.0).problem(frames=6),
        ["rk4", "explicit-euler"],
        (40, 60, 90),
        {"rtol": 1e-6, "accuracy": 3e-4},
    ),
    "one step size": (Rope(num_nodes=3).problem(frames=3), ["rk4", "explicit-euler"], (16,), {}),
    # Its errors are all zero.
    "still": (
        Rope(num_nodes=3, gravity=[0, 0]).problem(frames=3),
        ["rk4"],
        (4, 8, 16),
        {},
    ),
}


@functools.cache
def make(kind, case):
    problem, steppers, steps, more = CASES[case]
    return PLOTS[kind].study(
        problem, steppers, steps, norm=None, **{"accuracy": None, "rtol": None, **more}
    )


@pytest.fixture(scope="session")
def study():
    """What a type of plot is drawn from, by type and case."""
    return make


@pytest.fixture(scope="session")
def quartic():
    return QUARTIC
