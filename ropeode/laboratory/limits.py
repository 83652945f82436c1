"""The most that one question may ask for, estimated before anything is computed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ropeode.errors import InputError
from ropeode.problems import Problem
from ropeode.steppers import Stepper
from ropeode.validation import bad_value, complaint, finite_number

MOST_NODES = 256
MOST_FRAMES = 600
# Numbers in the state of a problem that the lab was opened with.
MOST_NUMBERS = 4096
# Steps of one run times the work of each, in numbers of a state that a compiled step advances: some
# seconds. A step in Python, and one of SciPy's solvers, cost as much as so many.
_MOST_WORK, _PYTHON, _SCIPY = 2**31, 2**13, 2**16
# What counts nodes, among the parameters of all problems.
_COUNTS = ("num_nodes", "num_masses")


def check_sizes(parameters: Mapping[str, Any], frames: int) -> None:
    """Refuse a problem that is too large, before it is built.

    Arguments:
        parameters: as the page sent them; what is no number is left to the problem's own checks.
        frames: of the problem.

    Raises:
        InputError: one line for each number that is too large.
    """
    counts = {name: parameters[name] for name in _COUNTS if name in parameters}
    given = [("frames", frames, MOST_FRAMES), *((n, v, MOST_NODES) for n, v in counts.items())]
    faults = [
        complaint(name, value, f"at most {most} in the lab", "use ropeode in Python for more")
        for name, value, most in given
        if _number(value) > most
    ]
    if faults:
        raise InputError(faults)


def _number(value: Any) -> float:
    """A number, which may be written as a text; of anything else, nothing is too large."""
    try:
        return finite_number(value)
    except ValueError:
        return 0.0


def check_given(problem: Problem) -> None:
    """Refuse a problem of the user's own that is too large.

    Raises:
        InputError: it has too many frames or numbers.
    """
    check_sizes({}, problem.frames)
    if problem.y0.size > MOST_NUMBERS:
        allowed = f"a state of at most {MOST_NUMBERS} numbers in the lab"
        raise bad_value("problem", f"{problem.y0.size} numbers", allowed, "use a smaller one")


def check_work(problem: Problem, stepper: Stepper, steps_per_frame: int, compiled: bool) -> None:
    """Refuse a run that would take longer than some seconds.

    Arguments:
        problem: what is solved.
        stepper: with what.
        steps_per_frame: of the run.
        compiled: whether JAX compiles the steps; others run in Python.

    Raises:
        InputError: it would.
    """
    most = _MOST_WORK // (problem.frames * _of_a_step(problem.y0.size, stepper, compiled))
    if steps_per_frame > most:
        raise bad_value(
            "steps_per_frame",
            steps_per_frame,
            f"at most {most} of {stepper.label} in the lab, with {problem.frames} frames of "
            f"{problem.y0.size} numbers",
            "take fewer steps, frames or nodes" if most else "choose another stepper",
        )


def _of_a_step(size: int, stepper: Stepper, compiled: bool) -> int:
    """What a step costs, in numbers of a state."""
    size = max(1, size)
    if stepper.label.startswith("scipy:"):
        return max(_SCIPY, size**2)
    if not compiled:
        return max(_PYTHON, size)
    if not stepper.label.startswith("diffrax:"):
        # An option of a stepper for ropes says how often it goes over all links.
        return size * getattr(stepper, "sweeps", 1)
    # Not above: it takes a second to import. An implicit step solves linear equations.
    import diffrax

    implicit = isinstance(getattr(stepper, "solver", None), diffrax.AbstractImplicitSolver)
    return 64 * size + size**3 // 8 if implicit else size
