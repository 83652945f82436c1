"""A user's function with a tolerance as a method."""

from __future__ import annotations

import dataclasses
import inspect
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from ropeode.errors import InputError, call_user_code
from ropeode.precision import in_float64
from ropeode.problems import Problem
from ropeode.references import finite_samples
from ropeode.study.methods.method import Attempt, Run
from ropeode.validation import shown, whole_number

PARAMETERS = ("problem", "rtol")


def is_solve(given: Any) -> bool:
    """Whether something is a function of a problem and a tolerance."""
    return parameters_of(given)[: len(PARAMETERS)] == PARAMETERS


def parameters_of(given: Any) -> tuple[str, ...]:
    """The names of a function's parameters; none of what is no function, or does not tell."""
    if inspect.isclass(given) or not callable(given):
        return ()
    try:
        return tuple(inspect.signature(given).parameters)
    except (TypeError, ValueError):
        return ()


def name_of(given: Any) -> str:
    """The name of a function, or of the type of an object that can be called."""
    return getattr(given, "__name__", type(given).__name__)


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
            # By the wall clock: it may wait for a program or a device that computes for it.
            began = time.perf_counter()
            returned = call_user_code(self.label, self.solve, problem, effort)
            taken = time.perf_counter() - began
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
    shape = (len(problem.ts), *problem.y0.shape)

    def wrong(what: str) -> InputError:
        return InputError(
            f"{label}: it returned {what}; allowed: (states, rhs_evaluations), with real states of "
            f"shape {shape} and a whole number >= 1 or None. Fix: return the states at problem.ts, "
            "and how often the right-hand side was evaluated."
        )

    if not isinstance(returned, tuple) or len(returned) != 2:
        raise wrong(shown(returned))
    given, calls = returned
    try:
        states = np.asarray(given)
    except ValueError:
        raise wrong("states of different lengths") from None
    if states.dtype.kind not in "iuf":
        raise wrong(f"states of type {states.dtype}")
    if np.ma.is_masked(given):
        raise wrong("states that are masked")
    if states.shape != shape:
        raise wrong(f"states of shape {states.shape}")
    try:
        calls = None if calls is None else whole_number(calls, at_least=1)
    except ValueError as error:
        raise wrong(f"{shown(calls)} evaluations ({error})") from None
    return states.astype(np.float64), calls
