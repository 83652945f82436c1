"""Solvers of other libraries as steppers, called as the libraries themselves call them."""

from __future__ import annotations

import importlib
import sys
from typing import Any, Protocol, cast

from ropeode.checking.step_signatures import Form
from ropeode.errors import InputError
from ropeode.validation import unknown

# Imported when they are asked for: diffrax takes a second.
LIBRARIES = {
    "diffrax": "ropeode.checking.adapters.diffrax_solvers",
    "scipy": "ropeode.checking.adapters.scipy_solvers",
}


class Adapter(Protocol):
    """What the module of a library has."""

    def names(self) -> list[str]:
        """The names of all solvers that the library exports."""
        ...

    def by_name(self, name: str) -> Form:
        """A solver by the name that the library exports it under."""
        ...

    def by_object(self, given: Any) -> Form | None:
        """A solver or its class; None if it is none of this library's."""
        ...


def adapted(library: str, name: str) -> Form:
    """A solver of another library, at constant step.

    Arguments:
        library: one of `LIBRARIES`.
        name: of the solver's class, as the library exports it.

    Raises:
        InputError: there is no such library or solver, or it cannot take constant steps.
    """
    if library not in LIBRARIES:
        raise InputError(unknown("library", library, LIBRARIES))
    return adapter(library).by_name(name)


def adapted_object(given: Any) -> Form | None:
    """The form of a solver object or class of a library; None if it is none.

    Arguments:
        given: anything.

    Raises:
        InputError: it is a solver that cannot take constant steps.
    """
    for library in LIBRARIES:
        # Nobody has an object of a library that was never imported.
        if library in sys.modules and (form := adapter(library).by_object(given)) is not None:
            return form
    return None


def adapter(library: str) -> Adapter:
    """The module of a library, imported.

    Arguments:
        library: one of `LIBRARIES`.
    """
    return cast(Adapter, importlib.import_module(LIBRARIES[library]))
