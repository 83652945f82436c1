"""Methods by name, and from whatever can be run at a ladder of efforts."""

from __future__ import annotations

import inspect
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ropeode.errors import InputError
from ropeode.problems import Problem, named_in_file
from ropeode.steppers import as_stepper, library_solvers
from ropeode.study.accuracy_table import problem_class
from ropeode.study.each_once import each_once, repeated
from ropeode.study.methods.adaptive import EXPLICIT, IMPLICIT, DiffraxAdaptive, ScipyAdaptive
from ropeode.study.methods.constant_steps import CONSTANT, ConstantSteps
from ropeode.study.methods.method import LadderMethod
from ropeode.study.methods.own_solver import PARAMETERS, OwnSolver, is_solve, name_of, parameters_of
from ropeode.validation import bad_value, unknown

_LIBRARIES = ("diffrax", "scipy")


def as_method(what: Any, folder: str | Path = ".") -> LadderMethod:
    """Whatever can be run at a ladder of efforts, as a method.

    Solvers of diffrax and SciPy that estimate their error are adaptive here, ``diffrax:Tsit5`` as
    ``scipy:RK45``; with constant steps they are ``diffrax:Tsit5:constant``. So are their classes.

    Arguments:
        what: such a name; a function ``solve(problem, rtol)``, also as ``FILE.py:NAME``; or
            whatever `ropeode.as_stepper` takes.
        folder: that a relative file name starts from; the current one by default.

    Raises:
        InputError: it is none of these.
        UserCodeError: the user's file or class raised.
    """
    if isinstance(what, str):
        return _named(what.strip(), Path(folder))
    if is_solve(what):
        return OwnSolver(what, name_of(what))
    if inspect.isclass(what):
        library = what.__module__.partition(".")[0]
        if library in _LIBRARIES:
            return _named(f"{library}:{what.__name__}", Path(folder))
    _refuse_other_parameters(what)
    return _constant(as_stepper(what))


def _refuse_other_parameters(what: Any) -> None:
    """Say what a function of two parameters should be: no step has so few."""
    names = parameters_of(what)
    if len(names) == len(PARAMETERS):
        raise bad_value(
            "method",
            f"{name_of(what)}({', '.join(names)})",
            f"solve({', '.join(PARAMETERS)}), and steps",
            f"name its parameters {' and '.join(PARAMETERS)}",
        )


def _named(text: str, folder: Path) -> LadderMethod:
    library, _, name = text.partition(":")
    if library in _LIBRARIES:
        name, _, how = name.partition(":")
        if how and f":{how}" != CONSTANT:
            raise InputError(unknown(f"option of {library}:{name}", how, [CONSTANT[1:]]))
        if how:
            return ConstantSteps(as_stepper(f"{library}:{name}"), text)
        return _of_diffrax(name) if library == "diffrax" else _of_scipy(name)
    if ".py:" in text:
        found = named_in_file(text, folder, what="method")
        if is_solve(found):
            return OwnSolver(found, text)
        _refuse_other_parameters(found)
    return _constant(as_stepper(text, folder=folder))


def _constant(stepper: Any) -> ConstantSteps:
    return ConstantSteps(stepper, stepper.label)


def _of_diffrax(name: str) -> LadderMethod:
    # Not above: diffrax takes a second.
    import diffrax

    from ropeode.steppers import DiffraxStepper

    stepper: Any = as_stepper(f"diffrax:{name}")
    if not isinstance(stepper.solver, diffrax.AbstractAdaptiveSolver):
        return _constant(stepper)
    if type(stepper) is not DiffraxStepper:
        raise bad_value(
            "method",
            stepper.label,
            "adaptive solvers that take the right-hand side whole; this one takes it in two parts",
            f"write {stepper.label}{CONSTANT}",
        )
    tableau = getattr(stepper.solver, "tableau", None)
    implicit = isinstance(stepper.solver, diffrax.AbstractImplicitSolver)
    implicit |= bool(getattr(tableau, "implicit", False))
    return DiffraxAdaptive(name, IMPLICIT if implicit else EXPLICIT)


def _of_scipy(name: str) -> ScipyAdaptive:
    if name not in (allowed := library_solvers("scipy")):
        raise InputError(unknown("solver of scipy", name, allowed))
    return ScipyAdaptive(name)


def chosen_methods(problem: Problem, given: Any, defaults: Sequence[str]) -> list[LadderMethod]:
    """Methods that can run on a problem, each once.

    Arguments:
        problem: to be solved.
        given: a list of whatever `as_method` takes, or one; None for those of the defaults that
            can run on the problem and are meant for it.
        defaults: names.

    Raises:
        InputError: one line for each that does not exist, is repeated or cannot run.
    """
    problem.require_equations()
    if given is None:
        return [each for name in defaults if _fits(each := as_method(name), problem)]

    def fault(method: LadderMethod, earlier: LadderMethod | None) -> str | None:
        if earlier is not None:
            another = isinstance(method, OwnSolver) and method != earlier
            fix = "give one of the functions another __name__" if another else "drop one"
            return repeated("method", method.label, fix)
        return method.refusal(problem)

    return each_once("method", given, as_method, "rk4 or diffrax:Tsit5", fault)


def _fits(method: LadderMethod, problem: Problem) -> bool:
    if isinstance(method, ConstantSteps) and not method.stepper.solves(problem_class(problem)):
        return False
    return method.refusal(problem) is None
