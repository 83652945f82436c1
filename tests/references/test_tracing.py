"""Kept programs of the primary solver: one where they are the same, others elsewhere."""

from __future__ import annotations

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from ropeode.problems import Problem
from ropeode.references import DOPRI8, KVAERNO5, solve

NEW = itertools.count(1)


@pytest.fixture
def logistic(cache_folder):
    """An equation of which this process has no program yet."""
    del cache_folder
    little = next(NEW) * 1e-300
    return lambda t, y, args: jnp.asarray(args) * y * (1 - y) + little


@pytest.fixture
def solved(cache_folder):
    """How many programs are kept after a run."""

    def run(rhs, y0=(0.1,), ts=(0.0, 1.0, 4.0), args=1.0, solver=DOPRI8, jumps=()):
        problem = Problem(lambda t, y, args: rhs(t, y, args), y0, ts, args, jump_times=jumps)
        solve(problem, solver, 1e-9, 1e-9, max_steps=1000)
        return len([*(cache_folder / "programs").glob("*")])

    return run


def test_what_differs_in_numbers_only_has_one_program(solved, logistic):
    assert solved(logistic) == 1
    assert solved(logistic, [0.2], [0, 3, 5], 4.0) == 1
    assert solved(lambda t, y, args: logistic(t, y, args) + 1e-300) == 2


@pytest.mark.slow
@pytest.mark.parametrize(
    "other",
    [{"args": np.ones(1)}, {"solver": KVAERNO5}, {"jumps": [2.0]}],
)
def test_what_differs_in_anything_else_has_another(solved, logistic, other):
    assert solved(logistic) == 1
    assert solved(logistic, **other) == 2


@pytest.mark.slow
def test_an_implicit_solver_sees_the_derivative(solved):
    def with_slope(factor):
        square = jax.custom_jvp(lambda y: y * y)
        square.defjvp(lambda primals, tangents: (square(*primals), factor * tangents[0]))
        return lambda t, y, args: -square(y)

    assert [solved(with_slope(factor)) for factor in (2.0, 3.0)] == [1, 1]
    assert [solved(with_slope(factor), solver=KVAERNO5) for factor in (2.0, 3.0)] == [2, 3]
