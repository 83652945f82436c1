"""How often diffrax evaluates a right-hand side and its Jacobian."""

from __future__ import annotations

import collections
import dataclasses
from collections.abc import Callable
from typing import Any

import diffrax
import jax

from ropeode.precision import in_float64
from ropeode.problems import Problem
from ropeode.references.solvers.diffrax_program import solution_of
from ropeode.references.solvers.diffrax_solver import solve, spare_samples
from ropeode.references.solvers.family import Family
from ropeode.references.solvers.solution import Solution
from ropeode.references.solvers.solver import Solver


class Counter:
    """Counts evaluations of runs that are not compensated.

    A step of an explicit Runge-Kutta method evaluates once for each stage; where its last stage is
    the next step's first, for one less. What implicit methods evaluate depends on how their
    equations are solved: their run is repeated with a right-hand side that counts its calls, which
    takes much longer.

    Arguments:
        problem: that is solved.
        solver: of diffrax.
    """

    def __init__(self, problem: Problem, solver: Solver):
        self._problem, self._solver = problem, solver
        self._program: Callable | None = None
        self._calls: collections.Counter[str] = collections.Counter()
        self._known: dict[float, tuple[int | None, int | None]] = {}

    def of(self, run: Solution) -> tuple[int | None, int | None]:
        """Evaluations of the right-hand side and of its Jacobian; None for runs that failed."""
        if run.failure is not None:
            return None, None
        method, jumps = getattr(diffrax, self._solver.method), len(self._problem.jump_times)
        explicit = explicit_evaluations(method, run.steps, jumps)
        if explicit is not None:
            return explicit, 0
        if run.rtol not in self._known:
            self._known[run.rtol] = self._counted(run)
        return self._known[run.rtol]

    @in_float64
    def _counted(self, run: Solution) -> tuple[int | None, int | None]:
        problem = self._problem
        if problem.in_python:
            # Its calls are callbacks of their own, and their Jacobian differences of them.
            return None, None
        if self._program is None:
            self._program = self._compiled()
        self._calls.clear()
        again = solve(
            problem, self._solver, run.rtol, run.atol, compensated=False, program=self._program
        )
        jax.effects_barrier()
        assert again.steps == run.steps
        return self._calls["rhs"], self._calls["jacobian"]

    def _compiled(self) -> Callable:
        samples = len(self._problem.ts)
        room = samples + spare_samples(samples)
        family = Family.of(self._problem, self._solver, room, compensated=False)
        counting = _Counting(
            **{each.name: getattr(family, each.name) for each in dataclasses.fields(family)},
            count=self._count,
        )
        return jax.jit(solution_of(counting)).lower(*family.inputs()).compile()

    def _count(self, what: str) -> None:
        self._calls[what] += 1


@dataclasses.dataclass(frozen=True)
class _Counting(Family):
    """A family whose right-hand side counts its calls."""

    count: Callable[[str], None] = print

    def field(self, t: Any, y: Any, leaves: Any) -> Any:
        """As that of the family."""
        own = super().field

        @jax.custom_jvp
        def counted(t: Any, y: Any, leaves: Any) -> Any:
            jax.debug.callback(self.count, "rhs")
            return own(t, y, leaves)

        @counted.defjvp
        def slope(primals: Any, tangents: Any) -> Any:
            jax.debug.callback(self.count, "jacobian")
            return jax.jvp(own, primals, tangents)

        return counted(t, y, leaves)


def explicit_evaluations(solver: type, steps: int, jumps: int = 0) -> int | None:
    """What so many steps of a solver of diffrax evaluate; None if it is no explicit Runge-Kutta.

    Arguments:
        solver: a class.
        steps: how many, rejected ones too.
        jumps: so many of them start anew.
    """
    if not issubclass(solver, diffrax.AbstractERK):
        return None
    tableau: Any = solver.tableau
    return (tableau.num_stages - tableau.fsal) * steps + (1 + jumps) * tableau.fsal
