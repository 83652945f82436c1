"""From what a user brings to a candidate, looked at closely before it is judged."""

from __future__ import annotations

import dataclasses
import functools
import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax
import numpy as np
from jax.core import Tracer

from ropeode.checking.adapters import LIBRARIES, adapted, adapted_object
from ropeode.checking.candidate import Candidate, Compiled, Interpreted, called, in_numpy
from ropeode.checking.problems import convergence_problems, generic
from ropeode.checking.step_signatures import AccelerationForm, Equations, Form, RhsForm, StepperForm
from ropeode.checking.time_limit import kept_output
from ropeode.errors import InputError, UserCodeError
from ropeode.precision import in_float64
from ropeode.problems.files import named_in_file
from ropeode.problems.problem import Problem
from ropeode.steppers import STEPPERS, stepper
from ropeode.steppers.base import Stepper
from ropeode.validation import complaint, unknown

RHS_PARAMETERS = ("rhs", "t", "y", "dt", "args")
ACCELERATION_PARAMETERS = ("acceleration", "t", "x", "v", "dt", "args")
# What else may be named than steppers of ropeode.
OTHER_NAMES = ("FILE.py:NAME", *(f"{library}:NAME" for library in LIBRARIES))
# Steps per frame on which compiled and uncompiled runs have to agree, and how closely. So many,
# that a step which counts how often it is called has counted to a hundred.
_TRIAL_STEPS, _SAME = 48, 1e-11
# With loops of JAX's own inside, which are slow where they are not compiled.
_TRIAL_STEPS_WITH_LOOPS = 2


@dataclasses.dataclass(frozen=True)
class Manners:
    """How a step behaves, apart from what it computes.

    Arguments:
        mutates: the names of the arguments that it writes to.
        repeats: whether the same input gives the same output, to the last bit.
        printed: the beginning of what it prints.
    """

    mutates: tuple[str, ...] = ()
    repeats: bool = True
    printed: str = ""


def brought(given: Any) -> tuple[str, Form | Stepper]:
    """What is to be judged, with what it is called.

    Arguments:
        given: a step function, a `Stepper` or a solver of another library (class or object),
            or a text: ``FILE.py:NAME``, ``diffrax:NAME``, ``scipy:NAME``, or the name of a
            stepper of ropeode.

    Raises:
        InputError: it is none of these.
        UserCodeError: the user's file raised.
    """
    if not isinstance(given, str):
        form = form_of(given)
        return form.label if isinstance(form, Stepper) else _name_of(given), form
    first, _, name = given.partition(":")
    if first in STEPPERS:
        return given, stepper(given)
    if first in LIBRARIES:
        return given, adapted(first, name)
    if ".py" in given:
        found = named_in_file(given, Path(), what="step")
        return given, form_of(found)
    raise InputError(unknown("stepper", given, [*STEPPERS, *OTHER_NAMES]))


def _name_of(given: Any) -> str:
    named = getattr(given, "__name__", None)
    return named or (type(given).__name__ if adapted_object(given) is not None else "step")


def form_of(given: Any) -> Form | Stepper:
    """The form of a step function, or a stepper.

    Raises:
        InputError: it is neither, or a solver that cannot take constant steps.
        UserCodeError: the stepper's class could not be made without arguments.
    """
    if isinstance(given, Stepper | Form):
        return given
    if (form := adapted_object(given)) is not None:
        return form
    if isinstance(given, type) and issubclass(given, Stepper):
        return called(given)
    if not callable(given) or isinstance(given, type):
        raise InputError(
            complaint(
                "step",
                given,
                "a step function or a Stepper",
                f"write def step({', '.join(ACCELERATION_PARAMETERS)})",
            )
        )
    return _form_by_parameters(given)


def _form_by_parameters(function: Callable) -> Form:
    try:
        parameters = [
            each
            for each in inspect.signature(function).parameters.values()
            if each.kind in (each.POSITIONAL_ONLY, each.POSITIONAL_OR_KEYWORD)
        ]
    except (TypeError, ValueError):
        parameters = []
    needed = [each.name for each in parameters if each.default is each.empty]
    names = tuple(each.name for each in parameters)
    for form, wanted in ((RhsForm, RHS_PARAMETERS), (AccelerationForm, ACCELERATION_PARAMETERS)):
        fits = len(needed) <= len(wanted) <= len(names)
        shuffled = set(names) == set(wanted) and names != wanted
        if fits and not shuffled:
            return form(function)
    raise InputError(
        f"step: its parameters are ({', '.join(names)}); allowed: "
        f"({', '.join(RHS_PARAMETERS)}), which returns the new y, or "
        f"({', '.join(ACCELERATION_PARAMETERS)}), which returns the new x and v. "
        "Fix: write one of these."
    )


@in_float64
def examined(label: str, given: Form | Stepper) -> tuple[Candidate, Manners]:
    """A candidate, and how it behaves in a first step.

    Arguments:
        label: what it is called.
        given: its form.

    Raises:
        InputError: it is a stepper that cannot run on a rope of springs.
        UserCodeError: it raises, or what it returns is no state.
    """
    if isinstance(given, Stepper):
        form: Form = StepperForm(given)
        if refusal := given.refusal(generic()):
            raise InputError(refusal)
    elif given.in_jax_only:
        return _only_compiled(Compiled(label, given, equal_frames=given.equal_frames)), Manners()
    else:
        form = given
    equal_frames = given.equal_frames
    if isinstance(given, Stepper) and type(given).__module__.startswith("ropeode."):
        return Compiled(label, form, equal_frames=equal_frames), Manners()
    asks, loops, mutates, repeats, printed = _first_steps(form)
    manners = Manners(mutates, repeats, printed)
    options = {"own_forces": not asks, "equal_frames": equal_frames}
    interpreted, compiled = Interpreted(label, form, **options), Compiled(label, form, **options)
    # What keeps something from call to call must not be traced: it would keep a tracer.
    if repeats and not form.in_python_only and _compiles(compiled, interpreted, loops):
        return compiled, manners
    return interpreted, manners


def _only_compiled(candidate: Compiled) -> Compiled:
    """A candidate that JAX has to compile, tried once."""
    with kept_output():
        called(candidate.run, generic(), _TRIAL_STEPS)
    return candidate


def _first_steps(form: Form) -> tuple[bool, bool, tuple[str, ...], bool, str]:
    """Whether it asks for forces, and in a loop of JAX's own; what it writes to and prints.

    And, as the fourth, whether it repeats itself.
    """
    problem = convergence_problems()["driven"]
    asked, loops = False, False
    equations = in_numpy(Equations.of(problem))

    def counted(function: Callable) -> Callable:
        @functools.wraps(function)
        def call(*given: Any) -> Any:
            nonlocal asked, loops
            asked = True
            loops = loops or isinstance(given[1], Tracer)
            return function(*given)

        return call

    assert equations.mechanics is not None
    acceleration = counted(equations.mechanics.acceleration)
    mechanics = dataclasses.replace(equations.mechanics, acceleration=acceleration)
    watched = Equations(counted(equations.rhs), acceleration, mechanics)
    changed: set[str] = set()

    def steps(y: np.ndarray) -> np.ndarray:
        """Two steps: what was carried by the first must not be lost on the second."""
        args = jax.tree.map(np.array, problem.args)
        given = y.copy()
        t, dt = float(problem.ts[0]), 0.01
        carried = called(form.init, watched, args, t, given, dt)
        before = jax.tree.map(np.array, (carried, args))
        after = called(form.step, watched, args, t, carried, dt)
        for name, was, now in zip(
            ("x or v" if isinstance(form, AccelerationForm) else "y", "args"),
            before,
            (carried, args),
            strict=True,
        ):
            same = jax.tree.map(lambda a, b: np.array_equal(a, b, equal_nan=True), was, now)
            if not all(jax.tree.leaves(same)):
                changed.add(name)
        y = np.asarray(called(form.state, watched, args, t + dt, after, dt))
        if not np.all(np.isfinite(y)):
            raise UserCodeError(
                "step: its first step from a regular state is not finite; allowed: finite "
                "positions and velocities. Fix: look for a division by zero or an overflow."
            )
        return y

    with kept_output() as printed, np.errstate(all="ignore"):
        first = steps(problem.y0)
        steps(problem.y0 + 0.125)
        again = steps(problem.y0)
    repeats = np.array_equal(first, again)
    return asked, loops, tuple(sorted(changed)), repeats, printed.getvalue()


def _compiles(compiled: Compiled, interpreted: Interpreted, loops: bool) -> bool:
    """Whether JAX can trace it, and what it compiles is the same as what Python makes of it."""
    steps = _TRIAL_STEPS_WITH_LOOPS if loops else _TRIAL_STEPS
    problem: Problem = convergence_problems()["uneven"]
    if compiled.equal_frames:
        problem = convergence_problems()["unequal"]
    try:
        with kept_output():
            fast = compiled.run(problem, steps)
    except Exception:
        # Whatever it is: then it runs in Python, where it shows for what it is.
        return False
    # Such a loop would be compiled anew at each step.
    with kept_output(), jax.disable_jit(loops):
        slow = interpreted.run(problem, steps)
    if not np.array_equal(np.isnan(fast), np.isnan(slow)):
        return False
    apart = np.max(np.abs(np.nan_to_num(fast - slow)))
    return bool(apart <= _SAME * np.max(np.abs(np.nan_to_num(slow))))
