"""Which runs of the primary solver share one compiled program."""

from __future__ import annotations

import dataclasses
import threading
import time
from collections.abc import Callable
from typing import Any

import jax
import numpy as np

from ropeode.problems import Problem
from ropeode.references.solvers.solver import Solver


@dataclasses.dataclass(frozen=True)
class Family:
    """Runs that one compiled program serves; all numbers of a problem are its inputs.

    Arguments:
        solver: a diffrax solver.
        rhs: ``rhs(t, y, args)`` of the problem.
        shape: of its state.
        args_tree: the structure of `args`.
        args_leaves: shape and dtype of each array in it.
        times: how many sample times; the last one may stand there several times.
        jumps: how many jump times.
        compensated: whether the steps keep what rounding takes from the state, as those of
            references do; if not, the solver is run as its library has it.
    """

    solver: Solver
    rhs: Callable
    shape: tuple[int, ...]
    args_tree: Any
    args_leaves: tuple[tuple[tuple[int, ...], Any], ...]
    times: int
    jumps: int
    compensated: bool = True

    @classmethod
    def of(cls, problem: Problem, solver: Solver, times: int, compensated: bool = True) -> Family:
        """The family of a problem's runs with so many sample times."""
        leaves, tree = jax.tree.flatten(problem.args)
        abstract_leaves = tuple((leaf.shape, leaf.dtype) for leaf in leaves)
        shape, jumps = problem.y0.shape, len(problem.jump_times)
        return cls(solver, problem.rhs, shape, tree, abstract_leaves, times, jumps, compensated)

    def field(self, t: Any, y: Any, leaves: Any) -> Any:
        """The right-hand side for flat states: one flat array is diffrax's fastest form."""
        args = jax.tree.unflatten(self.args_tree, leaves)
        return self.rhs(t, y.reshape(self.shape), args).reshape(-1)

    def inputs(self) -> tuple:
        """Shapes and dtypes of the program's inputs; see `diffrax_program.solution_of`."""
        number = abstract(())
        return (
            abstract((int(np.prod(self.shape)),)),
            [abstract(*leaf) for leaf in self.args_leaves],
            abstract((self.times,)),
            abstract((self.jumps,)),
            number,
            abstract((int(np.prod(self.shape)),)),
            abstract((), np.int64),
            abstract((self.times - 1,)),
            abstract((), np.int64),
        )


def abstract(shape: tuple[int, ...], dtype: Any = np.float64) -> jax.ShapeDtypeStruct:
    """An array of which only shape and dtype are fixed."""
    return jax.ShapeDtypeStruct(shape, dtype)


_compiling = threading.Lock()


def compiled_once(compiles: Any, *key: Any) -> tuple[Callable, float]:
    """A compiled program, and the seconds that compiling it has taken now; 0 if it was there.

    Where several threads want the same program, one compiles it and the others wait.

    Arguments:
        compiles: a function with a cache of `functools.lru_cache`.
        key: its inputs.
    """
    began = time.perf_counter()
    with _compiling:
        before = compiles.cache_info().misses
        program = compiles(*key)
        fresh = compiles.cache_info().misses > before
    return program, time.perf_counter() - began if fresh else 0.0
