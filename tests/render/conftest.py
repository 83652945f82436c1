"""Studies that hold all that a plot can be asked to show."""

from __future__ import annotations

import functools

import pytest

from ropeode import Problem, Rope, reference
from ropeode.render import PLOTS
from tests.quartic import quartic


@functools.cache
def cases():
    """Problem, steppers, steps per frame and options of the reference, by name.

    Ropes of 4 nodes over 3 frames share what they compile with `small_rope`.
    """
    return {
        # Orders, unresolved errors, round-off and some that blow up.
        "rope": (
            Rope(num_nodes=4, damping=0.0).problem(frames=3),
            ["stormer-verlet", "rk4", "explicit-euler"],
            (4, 8, 33, 66, 132, 1000, 3000, 30000),
            {},
        ),
        "diverged": (quartic(), ["explicit-euler", "rk4"], (2, 512, 1024), {}),
        "long names": (
            Rope(num_nodes=4).problem(frames=3),
            ["stormer-verlet:start=rest,damping=per-step", "stormer-verlet:damping=lagged", "rk4"],
            (4, 8),
            {},
        ),
        # The reference ends before the frames do.
        "cut": (
            Rope(num_nodes=4, damping=0.0).problem(frames=3),
            ["rk4", "explicit-euler"],
            (40, 60, 90),
            {"rtol": 1e-6, "accuracy": 3e-4},
        ),
        "one step size": (
            Rope(num_nodes=4).problem(frames=3),
            ["rk4", "explicit-euler"],
            (16,),
            {},
        ),
        # The equation of the longest steps has no solution.
        "unsolved": (
            Problem(lambda t, y, args: y**2, [1.0], [0.0, 0.3, 0.6]),
            ["implicit-euler"],
            (1, 16, 32, 64),
            {},
        ),
        # Its errors are all zero.
        "still": (
            Rope(num_nodes=4, gravity=[0, 0]).problem(frames=3),
            ["rk4"],
            (4, 8, 16),
            {},
        ),
    }


@functools.cache
def reference_of(case):
    problem, _, _, options = cases()[case]
    return reference(problem, **options)


@functools.cache
def make(kind, case):
    _, steppers, steps, _ = cases()[case]
    return PLOTS[kind].study(reference_of(case), steppers, steps_per_frame=steps, norm=None)


@pytest.fixture(scope="session")
def study():
    """What a type of plot is drawn from, by type and case."""
    return make
