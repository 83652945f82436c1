"""A run with more digits as a witness of float64 runs, where it is cheap."""

from __future__ import annotations

import importlib.util
import math
from typing import Any

import numpy as np

from ropeode.errors import InputError
from ropeode.problems import Problem
from ropeode.problems.nested_jaxprs import inside
from ropeode.progress import Progress
from ropeode.references.extended.guards import traced_once
from ropeode.references.extended.rules import MOVES
from ropeode.references.extended.taylor import HARDWARE, in_hardware, solve
from ropeode.references.solvers.solution import Solution

# A right-hand side of more operations on numbers takes heyoka longer to compile than all other
# witnesses take; so many of them in all steps, longer to run. See docs/explanation/certificate.md.
MOST_OPERATIONS = 500
_MOST_IN_ALL = 3e6
# Its steps end beside those of the float64 run with short steps, so that the two see other times.
_BESIDE = 0.97
# What `operations` counts for one number of their results.
_COUNTED = ("dot_general", "lu", "cholesky", "triangular_solve", "fft", "conv_general_dilated")


def run_beyond_float64(
    problem: Problem, like: Solution, longest_steps: np.ndarray, progress: Progress
) -> Solution | None:
    """The run of heyoka's Taylor method in the processor's longest numbers, rounded to float64.

    It shares neither the rounding of the float64 solvers nor that of the right-hand side. What it
    costs is known before: no clock decides whether there is such a run.

    Arguments:
        problem: what to solve.
        like: the run of the primary solver that it is compared with.
        longest_steps: in each frame of the float64 run with short steps. A Taylor series sees
            nothing that its start does not announce.
        progress: called at the start.

    Returns:
        None where heyoka is not installed, the processor has no such numbers, it would cost more
        than the other witnesses, the right-hand side cannot be translated, the run does not get
        as far as the other one, or all that is between the two it explains by its own steps.
    """
    if importlib.util.find_spec("heyoka") is None or not in_hardware() or problem.in_python:
        return None
    count, pieces = operations(problem), len(problem.jump_times) + 1
    longest = _BESIDE * longest_steps
    steps = like.steps + float(np.sum(np.ceil(np.diff(problem.ts) / longest)))
    if pieces * count > MOST_OPERATIONS or steps * count > _MOST_IN_ALL:
        return None
    try:
        run = solve(
            problem,
            precision=HARDWARE,
            max_steps=steps,
            longest_steps=longest,
            progress=progress,
        )
    except InputError:
        return None
    samples = len(like.states)
    if run.reached < samples:
        return None
    apart = np.abs(run.rounded[:samples] - like.states).reshape(samples, -1).max(axis=1)
    large = apart > like.rtol * problem.scale
    if np.any(large) and np.all(run.doubts[:samples][large] >= apart[large]):
        return None
    return run.in_float64


def operations(problem: Problem) -> float:
    """How many operations on numbers the right-hand side has; infinite if that depends."""
    return _operations(traced_once(problem).jaxpr)


def _operations(jaxpr: Any) -> float:
    total = 0.0
    for equation in jaxpr.eqns:
        name, params = equation.primitive.name, equation.params
        if name == "while":
            return math.inf
        if inner := inside(equation):
            total += params.get("length", 1) * max(map(_operations, inner))
        elif name not in MOVES:
            size = sum(math.prod(variable.aval.shape) for variable in equation.outvars)
            shape = equation.invars[0].aval.shape if name in _COUNTED else ()
            total += size * max(shape, default=1)
    return total
