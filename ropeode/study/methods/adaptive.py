"""Adaptive solvers of diffrax and SciPy as methods, whose effort is a tolerance."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import warnings

from ropeode.errors import InputError
from ropeode.precision import in_float64
from ropeode.problems import Problem
from ropeode.references import Counter, Solution, Solver, functions_of, solve
from ropeode.study.methods.method import Attempt, Run, Status, tolerances

EXPLICIT, IMPLICIT = "adaptive explicit", "adaptive implicit"
# Of SciPy's solvers: LSODA changes between both kinds.
_IMPLICIT_IN_SCIPY = ("BDF", "Radau", "LSODA")
# Runs end here at the latest. diffrax's own limit is 4096, and a tolerance is no step size.
MOST_STEPS = 10_000_000


@dataclasses.dataclass(frozen=True)
class DiffraxAdaptive:
    """A solver of diffrax with a PID controller, as diffrax has it.

    Its steps end on the sample times, so that no value is interpolated.

    Arguments:
        name: in diffrax.
        family: `EXPLICIT` or `IMPLICIT`.
    """

    name: str
    family: str

    adaptive = True

    @property
    def label(self) -> str:
        """As on the command line."""
        return f"diffrax:{self.name}"

    def refusal(self, problem: Problem) -> str | None:
        """It runs on whatever has a right-hand side in JAX or NumPy."""
        del problem
        return None

    def ready(self, problem: Problem) -> Run:
        """Compile the solver; one program serves all tolerances."""
        solver = Solver("diffrax", self.name)
        solved = functools.partial(solve, problem, solver, compensated=False)
        with contextlib.suppress(InputError):
            solved(*tolerances(problem, 1e-3), max_steps=1)
        counter = Counter(problem, solver)

        def run(effort: float, seconds: float) -> Attempt:
            both = tolerances(problem, effort)
            found = solved(*both, max_steps=MOST_STEPS, seconds=seconds)
            rhs, jacobians = counter.of(found)
            found = dataclasses.replace(found, rhs_evaluations=rhs, jacobian_evaluations=jacobians)
            return _attempt(found, problem)

        return run


@dataclasses.dataclass(frozen=True)
class ScipyAdaptive:
    """A solver class of SciPy, driven from one sample time to the next.

    Implicit solvers get the exact Jacobian, but for LSODA, which finds it by differences where it
    needs one.

    Arguments:
        name: in `scipy.integrate`.
    """

    name: str

    adaptive = True

    @property
    def family(self) -> str:
        """Whether it solves equations in its steps."""
        return IMPLICIT if self.name in _IMPLICIT_IN_SCIPY else EXPLICIT

    @property
    def label(self) -> str:
        """As on the command line."""
        return f"scipy:{self.name}"

    def refusal(self, problem: Problem) -> str | None:
        """It runs on whatever has a right-hand side."""
        del problem
        return None

    @in_float64
    def ready(self, problem: Problem) -> Run:
        """Compile the right-hand side, and its Jacobian where the solver needs it."""
        solver = Solver("SciPy", self.name)
        functions = functions_of(problem, solver.implicit)

        def run(effort: float, seconds: float) -> Attempt:
            both = tolerances(problem, effort)
            limits = {"max_steps": MOST_STEPS, "seconds": seconds}
            # LSODA warns where it gives up, which the status says.
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                found = solve(problem, solver, *both, **limits, functions=functions)
            return _attempt(found, problem)

        return run


def _attempt(found: Solution, problem: Problem) -> Attempt:
    return Attempt(
        status=_status(found),
        why=found.failure,
        states=found.states,
        steps=found.steps,
        rhs_evaluations=found.rhs_evaluations,
        jacobian_evaluations=found.jacobian_evaluations,
        seconds=found.seconds,
    )


def _status(found: Solution) -> Status:
    if found.failure is None:
        return "ok"
    if found.ran_out:
        return "step limit" if found.steps >= MOST_STEPS else "time limit"
    return "diverged" if found.failure.endswith("not finite") else "failed"
