"""Running a traced function on values of any kind, one primitive after the other."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple, NoReturn, Protocol

import jax.numpy as jnp
import numpy as np

from ropeode.errors import InputError
from ropeode.problems.nested_jaxprs import equations, evaluated, inside, split_scan
from ropeode.references.solvers.rounding import CALLS

# A loop of more rounds is not unrolled.
_MOST_ROUNDS = 1000


class Value(NamedTuple):
    """What a variable of the traced function holds.

    Fields:
        content: the array, of the kind that a `Domain` works on.
        moves: whether it depends on the state or the time.
        origin: of integers and truth values that move, the primitive that looked at
            floating-point numbers.
    """

    content: Any
    moves: bool
    origin: str | None = None


class Domain(Protocol):
    """What the variables hold, and what primitives do to it."""

    def constant(self, array: Any) -> Any:
        """The content of a constant."""
        ...

    def apply(self, equation: Any, inputs: Sequence[Value]) -> Iterable[Any]:
        """The contents of a primitive's results."""
        ...

    def decide(self, value: Value) -> np.ndarray:
        """The number that says which branch is taken, or whether a loop goes on."""
        ...

    def stacked(self, rows: Sequence[Any], variable: Any) -> Any:
        """Contents stacked along a new first axis, like `variable`."""
        ...


def refuse(name: str, how: str = "") -> NoReturn:
    """Say that a primitive has no counterpart in extended precision.

    Raises:
        InputError: always.
    """
    raise InputError(
        f"rhs: uses the JAX primitive {name!r}{how}, which cannot be computed in extended "
        "precision; allowed: arithmetic, powers, elementary functions, where, max, sort, cond and "
        "other choices, indexing, sums and products, linear systems, FFT, loops of fixed length; "
        "in float64. Fix: write it with these, or use a reference of level 'consensus'."
    )


def walk(traced: Any, inputs: Iterable[Value], domain: Domain) -> list[Value]:
    """The results of a jaxpr, closed or without constants, on one input for each argument.

    Calls are entered, loops are unrolled, and of conditional branches one is taken.
    """

    def apply(equation: Any, inputs: list[Value]) -> list[Value]:
        name = equation.primitive.name
        if name in CALLS:
            return walk(inside(equation)[0], inputs, domain)
        if name in _CONTROL:
            return _CONTROL[name](equation, inputs, domain)
        return _applied(equation, inputs, domain) if equation.outvars else []

    return evaluated(traced, inputs, apply, lambda c: Value(domain.constant(c), False))


def steers(traced: Any) -> bool:
    """Whether a jaxpr has branches or loops that depend on a number."""
    return any(equation.primitive.name in ("cond", "while") for equation in equations(traced))


def bind(equation: Any, contents: Sequence[Any], params: Any = None) -> list[Any]:
    """The results of a primitive on arrays of numbers.

    Arguments:
        equation: that applies it.
        contents: the arrays.
        params: of the primitive, if not those of the equation.
    """
    try:
        results = equation.primitive.bind(*contents, **(params or equation.params))
    except Exception as error:
        name, words = equation.primitive.name, " ".join(str(error).split())
        refuse(name, f" (which raised {type(error).__name__}: {words[:100]})")
    return list(results) if equation.primitive.multiple_results else [results]


def is_float(variable: Any) -> bool:
    """Whether a variable of a jaxpr is an array of floating-point or complex numbers."""
    return jnp.issubdtype(variable.aval.dtype, np.inexact)


def is_complex(variable: Any) -> bool:
    """Whether it is an array of complex numbers."""
    return jnp.issubdtype(variable.aval.dtype, np.complexfloating)


def _applied(equation: Any, inputs: Sequence[Value], domain: Domain) -> list[Value]:
    contents = domain.apply(equation, inputs)
    moves = any(value.moves for value in inputs)
    looks = any(
        value.moves and is_float(variable)
        for value, variable in zip(inputs, equation.invars, strict=True)
    )
    before = next((value.origin for value in inputs if value.origin), None)
    origin = equation.primitive.name if looks else before
    return [
        Value(content, moves, None if is_float(variable) or not moves else origin)
        for content, variable in zip(contents, equation.outvars, strict=True)
    ]


def _scan(equation: Any, inputs: Sequence[Value], domain: Domain) -> list[Value]:
    """A loop over the first axis of some inputs, round by round."""
    params = equation.params
    constants, carry, rows = split_scan(equation, inputs)
    carried = len(carry)
    rounds = _counted(range(params["length"]), "scan")
    collected: list[list[Value]] = []
    for i in reversed(rounds) if params["reverse"] else rounds:
        row = [
            value if value.content is None else value._replace(content=value.content[i, ...])
            for value in rows
        ]
        results = walk(params["jaxpr"], [*constants, *carry, *row], domain)
        carry = results[:carried]
        collected.append(results[carried:])
    if params["reverse"]:
        collected.reverse()
    stacks = []
    for k, variable in enumerate(equation.outvars[carried:]):
        column = [row[k] for row in collected]
        stacks.append(
            Value(
                domain.stacked([value.content for value in column], variable),
                any(value.moves for value in column),
                next((value.origin for value in column if value.origin), None),
            )
        )
    return [*carry, *stacks]


def _while(equation: Any, inputs: Sequence[Value], domain: Domain) -> list[Value]:
    """A loop that goes on while a condition holds."""
    params = equation.params
    for_condition, for_body = params["cond_nconsts"], params["body_nconsts"]
    condition = inputs[:for_condition]
    body = inputs[for_condition : for_condition + for_body]
    carry = list(inputs[for_condition + for_body :])
    for done in itertools.count():
        _counted(range(done), "while")
        goes_on = domain.decide(walk(params["cond_jaxpr"], [*condition, *carry], domain)[0])
        if not np.any(goes_on):
            return carry
        after = walk(params["body_jaxpr"], [*body, *carry], domain)
        carry = after if np.all(goes_on) else _where(goes_on, after, carry)
    raise AssertionError


def _where(condition: np.ndarray, some: Sequence[Value], others: Sequence[Value]) -> list[Value]:
    """Of loops side by side, some have ended."""
    chosen = []
    for a, b in zip(some, others, strict=True):
        content = a.content
        if content is not None:
            where = np.where if isinstance(content, np.ndarray) else jnp.where
            shape = condition.shape + (1,) * (content.ndim - condition.ndim)
            content = where(condition.reshape(shape), content, b.content)
        chosen.append(Value(content, a.moves or b.moves, a.origin or b.origin))
    return chosen


def _counted(rounds: range, name: str) -> range:
    if len(rounds) > _MOST_ROUNDS:
        refuse(name, f" with more than {_MOST_ROUNDS} rounds")
    return rounds


def _cond(equation: Any, inputs: Sequence[Value], domain: Domain) -> list[Value]:
    """One of several branches."""
    branches = equation.params["branches"]
    return walk(branches[int(domain.decide(inputs[0]))], inputs[1:], domain)


def _linear_solve(equation: Any, inputs: Sequence[Value], domain: Domain) -> list[Value]:
    """A linear system with a way to solve it, which is followed."""
    lengths, ways = equation.params["const_lengths"], equation.params["jaxprs"]
    before = lengths.matvec + lengths.vecmat
    constants = inputs[before : before + lengths.solve]
    right = inputs[sum(lengths) :]
    return walk(ways.solve, [*constants, *right], domain)


_CONTROL = {
    "scan": _scan,
    "while": _while,
    "cond": _cond,
    "custom_linear_solve": _linear_solve,
}
