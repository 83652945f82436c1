"""Kept programs of the primary solver: found again where they are the same, and nowhere else."""

from __future__ import annotations

import equinox.internal
import jax
import numpy as np
import pytest

from ropeode.problems import Problem
from ropeode.references.solvers import diffrax_solver, program_cache
from ropeode.references.solvers.family import Family
from ropeode.references.solvers.solver import DOPRI8, KVAERNO5


@pytest.fixture
def kept(cache_folder, monkeypatch):
    """A folder for programs, without Equinox's checks, as the command line has it."""
    # It says so before Equinox is imported, and here that has happened.
    monkeypatch.setattr(equinox.internal, "error_if", lambda x, *_: x)
    yield cache_folder / "programs"
    program_cache._compiled.cache_clear()


def logistic():
    return Problem(lambda t, y, args: args * y * (1 - y), [0.1], [0.0, 1.0, 4.0], args=1.0)


def solve(problem):
    program_cache._compiled.cache_clear()
    return diffrax_solver.solve(problem, DOPRI8, 1e-9, 1e-9, max_steps=1000)


def test_a_kept_program_is_the_same(kept, monkeypatch):
    traced = solve(logistic())
    assert len([*kept.iterdir()]) == 1
    # What is read is not made.
    with monkeypatch.context() as patch:
        patch.setattr(program_cache, "_source", None)
        read = solve(logistic())
    assert traced.states.tobytes() == read.states.tobytes()
    assert traced.steps == read.steps


@pytest.mark.slow
def test_a_program_that_is_not_kept_is_the_same(kept, monkeypatch):
    traced = solve(logistic())
    monkeypatch.setattr("ropeode.cache._folder", None)
    plain = solve(logistic())
    assert plain.states.tobytes() == traced.states.tobytes()
    assert plain.steps == traced.steps


def key_of(rhs, y0=(1.0,), ts=(0.0, 1.0), args=1.0, solver=DOPRI8, jumps=0):
    leaves, tree = jax.tree.flatten(np.asarray(args))
    abstract = tuple((leaf.shape, leaf.dtype) for leaf in leaves)
    with jax.enable_x64(True):
        return program_cache._description(
            Family(solver, rhs, np.shape(y0), tree, abstract, len(ts), jumps)
        )


def test_what_differs_in_numbers_only_has_one_program():
    assert key_of(lambda t, y, args: args * y) == key_of(lambda s, z, a: a * z, [2.0], [3, 5], 4.0)


@pytest.mark.parametrize(
    "other",
    [
        {"rhs": lambda t, y, args: args + y},
        {"rhs": lambda t, y, args: args * y + 1e-300},
        {"y0": [1.0, 2.0]},
        {"ts": [0.0, 1.0, 2.0]},
        {"args": [1.0]},
        {"solver": KVAERNO5},
        {"jumps": 1},
    ],
)
def test_what_differs_in_anything_else_has_another(other):
    assert key_of(lambda t, y, args: args * y) != key_of(
        **{"rhs": lambda t, y, args: args * y} | other
    )


def test_an_implicit_solver_sees_the_derivative():
    def with_slope(factor):
        square = jax.custom_jvp(lambda y: y * y)
        square.defjvp(lambda primals, tangents: (square(*primals), factor * tangents[0]))
        return lambda t, y, args: square(y)

    two, three = with_slope(2.0), with_slope(3.0)
    assert key_of(two) == key_of(three)
    assert key_of(two, solver=KVAERNO5) != key_of(three, solver=KVAERNO5)


def test_what_cannot_be_kept_is_solved_all_the_same(kept):
    def rhs(t, y, args):
        jax.debug.callback(lambda: None)
        return 0.5 * y

    run = solve(Problem(rhs, [1.0], [0.0, 1.0]))
    assert abs(run.states[-1, 0] - np.exp(0.5)) < 1e-8
    assert not kept.exists()
