"""The parameters that a user's function has, and the line to write where it needs others."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence

from ropeode.errors import InputError

_TIMES = ("t", "time")


def positional(function: Callable) -> list[inspect.Parameter] | None:
    """The positional parameters of a function; None where nobody can tell."""
    try:
        parameters = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):
        return None
    kinds = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
    return [each for each in parameters if each.kind in kinds]


def required(function: Callable) -> list[str] | None:
    """The names of the positional parameters without a default; None where nobody can tell."""
    parameters = positional(function)
    if parameters is None:
        return None
    return [each.name for each in parameters if each.default is each.empty]


def check_signature(what: str, function: Callable, wanted: Sequence[str], example: str) -> None:
    """See that a function takes so many positional arguments, and the time first.

    Arguments:
        what: it is called, for messages.
        function: the user's.
        wanted: names of the arguments, in the order in which they are given.
        example: what else to write where it takes others.

    Raises:
        InputError: it takes others.
    """
    parameters = positional(function)
    if parameters is None:
        return
    names = [each.name for each in parameters]
    try:
        inspect.signature(function).bind(*wanted)
    except TypeError:
        fix = f"write `def {_name(function)}({', '.join(wanted)}):`"
        raise InputError(
            f"{what}: a function of ({', '.join(names)}) given; allowed: one of "
            f"({', '.join(wanted)}). Fix: {fix}{example}."
        ) from None
    if [*wanted[:2]] == ["t", "y"] and [name in _TIMES for name in names[:2]] == [False, True]:
        fix = f"hand over `lambda t, y, *args: {_name(function)}(y, t, *args)`"
        raise InputError(
            f"{what}: a function of ({', '.join(names)}) given, the order of odeint; allowed: one "
            f"of ({', '.join(wanted)}). Fix: {fix}, or exchange the parameters."
        )


def _name(function: Callable) -> str:
    name = getattr(function, "__name__", "rhs")
    return name if name.isidentifier() else "rhs"
