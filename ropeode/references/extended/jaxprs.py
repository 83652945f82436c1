"""Running a traced function on values of any kind, one primitive after the other."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple, Protocol

import jax.numpy as jnp
import numpy as np

# Primitives that call another traced function with their own inputs.
_CALLS = {
    "jit",
    "pjit",
    "closed_call",
    "core_call",
    "checkpoint",
    "remat2",
    "custom_jvp_call",
    "custom_vjp_call",
    "custom_vjp_call_jaxpr",
}


class Value(NamedTuple):
    """What a variable of the traced function holds.

    Fields:
        content: the array, of the kind that a `Domain` works on.
        moves: whether it depends on the state or the time.
    """

    content: Any
    moves: bool


class Domain(Protocol):
    """What the variables hold, and what primitives do to it."""

    def constant(self, array: Any) -> Any:
        """The content of a constant."""
        ...

    def apply(self, equation: Any, inputs: Sequence[Value]) -> Iterable[Any]:
        """The contents of a primitive's results."""
        ...


def walk(traced: Any, inputs: Iterable[Value], domain: Domain) -> list[Value]:
    """The results of a jaxpr, closed or without constants, on one input for each argument.

    Calls are entered, and loops of known length are unrolled.
    """
    jaxpr = getattr(traced, "jaxpr", traced)
    constants = [Value(domain.constant(c), False) for c in getattr(traced, "consts", ())]
    values = dict(zip(jaxpr.invars, inputs, strict=True))
    values.update(zip(jaxpr.constvars, constants, strict=True))

    def read(variable: Any) -> Value:
        if hasattr(variable, "val"):
            return Value(domain.constant(variable.val), False)
        return values[variable]

    for equation in jaxpr.eqns:
        if not equation.outvars:
            continue
        inputs = [read(variable) for variable in equation.invars]
        name, params = equation.primitive.name, equation.params
        if name == "scan":
            results = _unrolled(params, inputs, domain)
        elif name in _CALLS:
            results = walk(params.get("jaxpr", params.get("call_jaxpr")), inputs, domain)
        else:
            moves = any(value.moves for value in inputs)
            results = [Value(content, moves) for content in domain.apply(equation, inputs)]
        values.update(zip(equation.outvars, results, strict=True))
    return [read(variable) for variable in jaxpr.outvars]


def bind(equation: Any, contents: Sequence[Any]) -> list[Any]:
    """The results of a primitive on arrays of numbers."""
    results = equation.primitive.bind(*contents, **equation.params)
    return list(results) if equation.primitive.multiple_results else [results]


def is_float(variable: Any) -> bool:
    """Whether a variable of a jaxpr is an array of floating-point numbers."""
    return jnp.issubdtype(variable.aval.dtype, np.floating)


def _unrolled(params: Any, inputs: Sequence[Value], domain: Domain) -> list[Value]:
    """A loop over the first axis of some inputs, round by round."""
    constants, carried = params["num_consts"], params["num_consts"] + params["num_carry"]
    carry, rows = list(inputs[constants:carried]), inputs[carried:]
    # That a round moves something may show in the next ones only.
    carry = [Value(value.content, any(each.moves for each in inputs)) for value in carry]
    rounds = range(params["length"])
    collected: list[list[Value]] = []
    for i in reversed(rounds) if params["reverse"] else rounds:
        row = [Value(value.content[i], value.moves) for value in rows]
        results = walk(params["jaxpr"], [*inputs[:constants], *carry, *row], domain)
        carry = results[: params["num_carry"]]
        collected.append(results[params["num_carry"] :])
    if params["reverse"]:
        collected.reverse()
    columns = zip(*collected, strict=True)
    return [*carry, *(_stacked(column) for column in columns)]


def _stacked(rows: Sequence[Value]) -> Value:
    contents = [row.content for row in rows]
    stack = np.stack if isinstance(contents[0], np.ndarray) else jnp.stack
    return Value(stack(contents), any(row.moves for row in rows))
