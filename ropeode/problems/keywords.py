"""Keywords that a function does not take, above all those of `scipy.integrate.solve_ivp`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from ropeode.errors import InputError
from ropeode.validation import complaint, unknown

_PIECES = "solve the pieces between the events one after the other, as docs/howto/events.md shows"
_STEPS = (
    "leave it out: the solvers choose their steps, and the right-hand side is looked at between "
    "them; times at which it jumps are jump_times"
)
_DERIVATIVES = "leave it out: derivatives come from JAX, or from differences"
_TOLERANCES = "hand it to reference(problem, rtol=..., atol=...)"

# What to do instead.
_OF_SCIPY = {
    "event": _PIECES,
    "events": _PIECES,
    "t_span": "hand it over as the second argument, as in Problem.from_scipy(fun, (0, 10), y0)",
    "t_eval": "hand the times over in place of the span, as in Problem.from_scipy(fun, ts, y0)",
    "method": (
        "leave it out: a reference rests on several solvers; simulate(problem, 'scipy:RK45', 16) "
        "is a run of one"
    ),
    "dense_output": "use reference(problem, dense=True)",
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
