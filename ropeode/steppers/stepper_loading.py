"""From whatever advances a state by dt to a `Stepper`: functions, classes, files, libraries."""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ropeode.errors import InputError, call_user_code
from ropeode.problems import named_in_file, names_in_file, names_in_text
from ropeode.steppers.base import Stepper
from ropeode.steppers.functions import (
    AccelerationFunction,
    StepFunction,
    signature_of,
    step_function,
)
from ropeode.steppers.registry import STEPPERS, registered_stepper
from ropeode.steppers.tableau_files import PREFIX, file_of, is_tableau_file, tableau_stepper
from ropeode.validation import bad_value, check_whole, unknown

# Imported when they are asked for: diffrax takes a second.
STEPPER_LIBRARIES = {
    "diffrax": "ropeode.steppers.diffrax_solvers",
    "scipy": "ropeode.steppers.scipy_solvers",
}
# What else may be named than steppers of ropeode.
OTHER_NAMES = (
    "FILE.py:NAME",
    f"{PREFIX}:FILE.toml",
    *(f"{library}:NAME" for library in STEPPER_LIBRARIES),
)


def as_stepper(
    what: Any,
    order: int | None = None,
    *,
    label: str | None = None,
    folder: str | Path = ".",
) -> Stepper:
    """Whatever advances a state by dt, as a `Stepper`.

    Arguments:
        what: a function ``step(rhs, t, y, dt, args)`` that returns the new state, or
            ``step(acceleration, t, x, v, dt, args)`` that returns the new positions and
            velocities ``(nodes, dim)``, in NumPy or JAX; a `Stepper`, class or object; a solver
            of diffrax (class or object) or of SciPy (class); or a text: the name of a stepper of
            ropeode with its options, ``FILE.py:NAME``, ``FILE.py`` with one stepper in it,
            ``runge-kutta:FILE.toml`` with a tableau, ``diffrax:NAME``, ``scipy:NAME``.
        order: that the author of a step function claims; other steppers declare their own.
        label: what tables and plots call a step function; by default its name.
        folder: that a relative file name starts from; the current one by default.

    Raises:
        InputError: it is none of these, or an argument does not go with it.
        UserCodeError: the user's file or class raised.

    Examples:
        >>> from ropeode import as_stepper
        >>> as_stepper("diffrax:Tsit5")
        DiffraxStepper(solver=Tsit5())
        >>> mine = as_stepper(lambda rhs, t, y, dt, args: y + dt * rhs(t, y, args), label="mine")
        >>> mine.label
        'mine'
    """
    if order is not None:
        order = check_whole("order", order, at_least=1, example="2")
    stepper = _named(what.strip(), Path(folder)) if isinstance(what, str) else _from_object(what)
    if order is None and label is None:
        return stepper
    if not isinstance(stepper, StepFunction):
        given, value = ("label", label) if order is None else ("order", order)
        allowed = f"none with {stepper.label!r}, which declares its own"
        fix = "leave it out, or give a step function"
        raise bad_value(given, value, allowed, fix)
    order = order or stepper.declared_order
    return dataclasses.replace(stepper, name=label or stepper.name, declared_order=order)


def users_file(text: str) -> str | None:
    """The user's file that a stepper's text names; None for a stepper of a package."""
    if is_tableau_file(text):
        return file_of(text)
    file = text if text.endswith(".py") else text.rpartition(":")[0]
    return file if file.endswith(".py") else None


def _named(text: str, folder: Path) -> Stepper:
    first, _, name = text.partition(":")
    if first in STEPPERS:
        return registered_stepper(text)
    if is_tableau_file(text):
        return tableau_stepper(text, folder)
    if first in STEPPER_LIBRARIES:
        solvers = library_solvers(first)
        if name not in solvers:
            raise InputError(unknown(f"solver of {first}", name, solvers))
        return _library(first).by_object(solvers[name])
    if text.endswith(".py"):
        text, found = _only_one_in(text, folder / text)
    elif ".py:" in text:
        found = named_in_file(text, folder, what="stepper")
    else:
        raise InputError(unknown("stepper", text, STEPPERS, OTHER_NAMES))
    return _from_object(found, text)


def _only_one_in(text: str, path: Path) -> tuple[str, Any]:
    """The only stepper that a file defines, and its whole name.

    Raises:
        InputError: there is none, or more than one.
    """
    steppers = _defined_in(names_in_file(path, "stepper"), text)
    if len(steppers) != 1:
        allowed = (
            f"FILE.py:NAME, or a file with one stepper in it; this one has {', '.join(steppers)}"
        )
        raise bad_value("stepper", text, allowed, "add the name")
    ((name, value),) = steppers.items()
    return name, value


def steppers_in_text(where: str, text: str) -> dict[str, Stepper]:
    """The steppers of a file with this text, which is run, by their whole names.

    Arguments:
        where: ``FILE.py:NAME`` for one of them, or ``FILE.py`` for all.
        text: of the file, which may have another one by now.

    Raises:
        InputError: there is none, or none of this name.
        UserCodeError: the text raised, or a class in it.
    """
    file, name = (where, "") if where.endswith(".py") else where.rsplit(":", 1)
    names = names_in_text(text, Path(file), "stepper")
    if not name:
        found = _defined_in(names, file)
    elif name in names:
        found = {where: names[name]}
    else:
        raise InputError(unknown(f"name in {file}", name, _defined_in(names, file)))
    return {whole: _from_object(each, whole) for whole, each in found.items()}


def _defined_in(names: Mapping[str, Any], file: str) -> dict[str, Any]:
    """The steppers that a file defines, by their whole names.

    Raises:
        InputError: there is none.
    """
    found = {
        f"{file}:{name}": value
        for name, value in names.items()
        if getattr(value, "__module__", None) == names["__name__"]
        and not name.startswith("_")
        and (_is_stepper_class(value) or (inspect.isfunction(value) and signature_of(value)))
    }
    if not found:
        allowed = "FILE.py:NAME, or a file with a stepper in it; this one has none"
        raise bad_value("stepper", file, allowed, _HOW_TO_WRITE_ONE)
    return found


_HOW_TO_WRITE_ONE = f"write def step({', '.join(AccelerationFunction.PARAMETERS)})"


def _is_stepper_class(value: Any) -> bool:
    return inspect.isclass(value) and issubclass(value, Stepper)


def _from_object(what: Any, label: str | None = None) -> Stepper:
    if isinstance(what, Stepper):
        return what
    if _is_stepper_class(what):
        return call_user_code("step", what)
    for name in STEPPER_LIBRARIES:
        # Nobody has an object of a library that was never imported.
        if name in sys.modules and (stepper := _library(name).by_object(what)) is not None:
            return stepper
    if not callable(what) or inspect.isclass(what):
        raise bad_value(
            "stepper",
            what,
            "a step function, a Stepper, or the name of one",
            f"{_HOW_TO_WRITE_ONE}, or give a name: {', '.join(STEPPERS)}",
        )
    name = getattr(what, "__name__", type(what).__name__)
    return step_function(what, label or name)


def library_solvers(library: str) -> dict[str, type]:
    """All solver classes that a library in `STEPPER_LIBRARIES` exports, by name."""
    own = _library(library)
    return {
        name: each
        for name, each in sorted(vars(own.LIBRARY).items())
        if inspect.isclass(each)
        and issubclass(each, own.SOLVER)
        and each is not own.SOLVER
        and not name.startswith("Abstract")
    }


def _library(name: str) -> Any:
    """The module for a library: its module `LIBRARY`, their base `SOLVER`, and `by_object`."""
    return importlib.import_module(STEPPER_LIBRARIES[name])
