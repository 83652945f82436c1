"""Parameters of users' functions, keywords of ropeode's, and what to write where they misfit."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from ropeode.errors import InputError
from ropeode.validation import complaint, unknown

TIMES = ("t", "time", "tau")

# Keywords, above all those of `scipy.integrate.solve_ivp`, and what to do instead.
_PIECES = "solve the pieces between the events one after the other, as docs/howto/events.md shows"
_STEPS = (
    "leave it out: the solvers choose their steps, and the right-hand side is looked at between "
    "them; times at which it jumps are jump_times"
)
_DERIVATIVES = "leave it out: derivatives come from JAX, or from differences"
_TOLERANCES = "hand it to reference(problem, rtol=..., atol=...)"
_BETWEEN = "leave it out: reference(problem).at(times) has the states at any times"
_OF_SCIPY = {
    "event": _PIECES,
    "events": _PIECES,
    "t_span": "hand it over as the second argument, as in Problem.from_scipy(fun, (0, 10), y0)",
    "t_eval": "hand the times over in place of the span, as in Problem.from_scipy(fun, ts, y0)",
    "method": (
        "leave it out: a reference rests on several solvers; simulate(problem, 'scipy:RK45', 16) "
        "is a run of one"
    ),
    "dense": _BETWEEN,
    "dense_output": _BETWEEN,
    "vectorized": "leave it out",
    "first_step": _STEPS,
    "min_step": _STEPS,
    "max_step": _STEPS,
    "jac": _DERIVATIVES,
    "jac_sparsity": _DERIVATIVES,
    "lband": _DERIVATIVES,
    "uband": _DERIVATIVES,
    "rtol": _TOLERANCES,
    "atol": _TOLERANCES,
}


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
        fix = f"write `def {_name(function, what)}({', '.join(wanted)}):`"
        if words := _required_words(function):
            given = ", ".join(f"{name}=..." for name in words)
            fix = f"hand over `functools.partial({_name(function, what)}, {given})`"
        raise InputError(
            f"{what}: a function of {_parameters(function)} given; allowed: one of "
            f"({', '.join(wanted)}). Fix: {fix}{example}."
        ) from None
    if [*wanted[:2]] == ["t", "y"] and [name in TIMES for name in names[:2]] == [False, True]:
        fix = f"hand over `lambda t, y, *args: {_name(function, what)}(y, t, *args)`"
        raise InputError(
            f"{what}: a function of ({', '.join(names)}) given, the order of odeint; allowed: one "
            f"of ({', '.join(wanted)}). Fix: {fix}, or exchange the parameters."
        )


def _parameters(function: Callable) -> str:
    """All that a function takes, without types and defaults."""
    signature = inspect.signature(function)
    plain = [
        each.replace(annotation=each.empty, default=each.empty)
        if each.default is each.empty
        else each.replace(annotation=each.empty)
        for each in signature.parameters.values()
    ]
    return str(signature.replace(parameters=plain, return_annotation=signature.empty))


def _required_words(function: Callable) -> list[str]:
    """The names of the parameters without a default that are given by name only."""
    every = inspect.signature(function).parameters.values()
    words = [each for each in every if each.kind is each.KEYWORD_ONLY]
    return [each.name for each in words if each.default is each.empty]


def _name(function: Callable, what: str) -> str:
    name = getattr(function, "__name__", what)
    return name if name.isidentifier() else what


def refuse_others(given: Mapping[str, Any], allowed: Iterable[str]) -> None:
    """Refuse keywords that a function does not take, with what to write instead.

    Arguments:
        given: the keywords and their values.
        allowed: the keywords that it takes.

    Raises:
        InputError: there are others, with one line for each.
    """
    names = list(allowed)
    faults = [
        complaint(name, value, ", ".join(names), _OF_SCIPY[name])
        if name in _OF_SCIPY
        else unknown("keyword", name, names)
        for name, value in given.items()
        if name not in names
    ]
    if faults:
        raise InputError(faults)
