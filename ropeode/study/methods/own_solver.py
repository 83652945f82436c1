"""A user's function with a tolerance as a method."""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Callable
from typing import Any

import numpy as np

from ropeode.errors import call_user_code
from ropeode.precision import in_float64
from ropeode.problems.problem import Problem
from ropeode.references.solvers.solution import finite_samples
from ropeode.references.solvers.stopwatch import Stopwatch
from ropeode.study.methods.method import Attempt, Run
from ropeode.validation import bad_value, whole_number

PARAMETERS = ("problem", "rtol")


def is_solve(given: Any) -> bool:
    """Whether something is a function of a problem and a tolerance."""
    if inspect.isclass(given) or not callable(given):
        return False
    try:
        parameters = tuple(inspect.signature(given).parameters)
    except (TypeError, ValueError):
        return False
    return parameters[:2] == PARAMETERS


@dataclasses.dataclass(frozen=True)
class OwnSolver:
    """A function ``solve(problem, rtol)``.

    It returns the states at ``problem.ts``, ``(times, *state)``, and how often it evaluated the
    right-hand side, or None. A run of it cannot be stopped.

    Arguments:
        solve: the function.
        label: as in tables and plots.
    """

    solve: Callable[[Problem, float], tuple[Any, int | None]]
    label: str

    family = "your own"
    adaptive = True

    def refusal(self, problem: Problem) -> str | None:
        """Its author knows."""
        del problem
        return None

    def ready(self, problem: Problem) -> Run:
        """Nothing is compiled: the first run of each effort is not timed."""

        @in_float64
        def run(effort: float, seconds: float) -> Attempt:
            del seconds
            stopwatch = Stopwatch()
            returned = call_user_code("solve", self.solve, problem, effort)
            taken = stopwatch.seconds
            states, calls = _checked(self.label, problem, returned)
            reached = finite_samples(states)
            lost = reached < len(problem.ts)
            return Attempt(
                status="diverged" if lost else "ok",
                why=f"its state is not finite at frame {reached}" if lost else None,
                states=states[:reached],
                steps=None,
                rhs_evaluations=calls,
                jacobian_evaluations=None,
                seconds=taken,
            )

        return run


def _checked(label: str, problem: Problem, returned: Any) -> tuple[np.ndarray, int | None]:
    wanted = (len(problem.ts), *problem.y0.shape)
    allowed = f"(states, rhs_evaluations), with states of shape {wanted}"
    fix = "return the states at problem.ts, and a whole number or None"
    if not isinstance(returned, tuple) or len(returned) != 2:
        raise bad_value(label, f"{type(returned).__name__} returned", allowed, fix)
    try:
        states = np.asarray(returned[0], dtype=np.float64)
        calls = None if returned[1] is None else whole_number(returned[1], at_least=1)
    except (TypeError, ValueError) as error:
        raise bad_value(label, returned, f"{allowed} ({error})", fix) from None
    if states.shape != wanted:
        raise bad_value(label, f"states of shape {states.shape} returned", allowed, fix)
    return states, calls
