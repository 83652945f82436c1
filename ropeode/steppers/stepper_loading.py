"""From whatever advances a state by dt to a `Stepper`: functions, classes, files, libraries."""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol, cast

from ropeode.errors import InputError, call_user_code
from ropeode.problems.files import named_in_file, names_in_file
from ropeode.steppers.base import Stepper
from ropeode.steppers.functions import AccelerationFunction, signature_of, step_function
from ropeode.steppers.registry import STEPPERS, registered
from ropeode.validation import check_whole, complaint, unknown

# Imported when they are asked for: diffrax takes a second.
LIBRARIES = {
    "diffrax": "ropeode.steppers.diffrax_solvers",
    "scipy": "ropeode.steppers.scipy_solvers",
}
# What else may be named than steppers of ropeode.
OTHER_NAMES = ("FILE.py:NAME", *(f"{library}:NAME" for library in LIBRARIES))


class Library(Protocol):
    """What the module of a library has."""

    def names(self) -> list[str]:
        """The names of all solvers that the library exports."""
        ...

    def by_name(self, name: str) -> Stepper:
        """A solver by the name that the library exports it under."""
        ...

    def by_object(self, given: Any) -> Stepper | None:
        """A solver or its class; None if it is none of this library's."""
        ...


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
            ``diffrax:NAME``, ``scipy:NAME``.
        order: that the author of a step function claims; other steppers declare their own.
        label: what tables and plots call a step function; by default its name.
        folder: that a relative file name starts from; the current one by default.

    Raises:
        InputError: it is none of these, or an argument does not go with it.
        UserCodeError: the user's file or class raised.
    """
    if order is not None:
        order = check_whole("order", order, at_least=1, example="2")
    stepper = _named(what.strip(), Path(folder)) if isinstance(what, str) else _from_object(what)
    claims = {"declared_order": order, "name": label}
    changes = {field: value for field, value in claims.items() if value is not None}
    if not changes:
        return stepper
    if not hasattr(stepper, "declared_order"):
        given = "order" if order is not None else "label"
        raise InputError(
            complaint(
                given,
                changes.popitem()[1],
                f"none with {stepper.label!r}, which declares its own",
                "leave it out, or give a step function",
            )
        )
    return dataclasses.replace(cast(Any, stepper), **changes)


def _named(text: str, folder: Path) -> Stepper:
    first, _, name = text.partition(":")
    if first in STEPPERS:
        return registered(text)
    if first in LIBRARIES:
        return library(first).by_name(name)
    if text.endswith(".py"):
        text, found = _only_one_in(text, folder / text)
    elif ".py:" in text:
        found = named_in_file(text, folder, what="step")
    else:
        raise InputError(unknown("stepper", text, [*STEPPERS, *OTHER_NAMES]))
    return _from_object(found, text)


def _only_one_in(text: str, path: Path) -> tuple[str, Any]:
    """The only stepper that a file defines, and its whole name.

    Raises:
        InputError: there is none, or more than one.
    """
    names = names_in_file(path, "step")
    steppers = {
        name: value
        for name, value in names.items()
        if getattr(value, "__module__", None) == names["__name__"]
        and not name.startswith("_")
        and (_is_stepper_class(value) or (inspect.isfunction(value) and signature_of(value)))
    }
    if len(steppers) != 1:
        listed = ", ".join(f"{text}:{name}" for name in steppers)
        raise InputError(
            complaint(
                "stepper",
                text,
                "FILE.py:NAME, or a file with one stepper in it"
                + (f"; this one has {listed}" if steppers else "; this one has none"),
                "add the name" if steppers else _HOW_TO_WRITE_ONE,
            )
        )
    ((name, value),) = steppers.items()
    return f"{text}:{name}", value


_HOW_TO_WRITE_ONE = f"write def step({', '.join(AccelerationFunction.PARAMETERS)})"


def _is_stepper_class(value: Any) -> bool:
    return inspect.isclass(value) and issubclass(value, Stepper)


def _from_object(what: Any, label: str | None = None) -> Stepper:
    if isinstance(what, Stepper):
        return what
    if _is_stepper_class(what):
        return call_user_code("step", what)
    for name in LIBRARIES:
        # Nobody has an object of a library that was never imported.
        if name in sys.modules and (stepper := library(name).by_object(what)) is not None:
            return stepper
    if not callable(what) or inspect.isclass(what):
        raise InputError(
            complaint(
                "stepper",
                what,
                "a step function, a Stepper, or the name of one",
                f"{_HOW_TO_WRITE_ONE}, or give a name: {', '.join(STEPPERS)}",
            )
        )
    return step_function(what, label or _name_of(what), None)


def _name_of(function: Callable) -> str:
    return getattr(function, "__name__", None) or type(function).__name__


def library(name: str) -> Library:
    """The module of a library, imported.

    Arguments:
        name: one of `LIBRARIES`.
    """
    return cast(Library, importlib.import_module(LIBRARIES[name]))
