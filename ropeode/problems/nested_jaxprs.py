"""Traced functions: the jaxprs inside their equations, and their results on values of any kind."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

from jax.extend.core import ClosedJaxpr, Jaxpr, JaxprEqn, Literal


def inside(equation: JaxprEqn) -> list[ClosedJaxpr | Jaxpr]:
    """The jaxprs that an equation calls, branches into, or repeats."""
    return [
        each
        for value in equation.params.values()
        for each in (value if isinstance(value, (tuple, list)) else (value,))
        if isinstance(each, (ClosedJaxpr, Jaxpr))
    ]


def equations(traced: ClosedJaxpr | Jaxpr) -> Iterator[JaxprEqn]:
    """All equations of a jaxpr, and of the jaxprs in them."""
    for equation in traced.eqns:
        yield equation
        for each in inside(equation):
            yield from equations(each)


def split_scan(equation: Any, inputs: Sequence[Any]) -> tuple[list[Any], list[Any], list[Any]]:
    """The inputs of a scan: its constants, what it carries from round to round, and its rows.

    The parameters that name them differ between versions of JAX. Shapes tell them too: an array
    that is read or stacked row by row has one axis more outside of the loop than inside.
    """
    body: Any = inside(equation)[0]
    read = zip(equation.invars, body.in_avals, strict=True)
    results = zip(equation.outvars, body.out_avals, strict=True)
    rows = sum(outside.aval.ndim > within.ndim for outside, within in read)
    carried = sum(outside.aval.ndim == within.ndim for outside, within in results)
    end = len(inputs) - rows
    return list(inputs[: end - carried]), list(inputs[end - carried : end]), list(inputs[end:])


def evaluated(
    traced: ClosedJaxpr | Jaxpr,
    inputs: Iterable[Any],
    apply: Callable[[JaxprEqn, list[Any]], Sequence[Any]],
    constant: Callable[[Any], Any] = lambda value: value,
) -> list[Any]:
    """The results of a jaxpr whose variables hold values of any kind.

    Arguments:
        traced: closed, or without constants.
        inputs: one for each argument.
        apply: ``apply(equation, inputs)``, the results of one equation.
        constant: what a variable holds for a constant.
    """
    jaxpr = traced.jaxpr if isinstance(traced, ClosedJaxpr) else traced
    constants = traced.consts if isinstance(traced, ClosedJaxpr) else ()
    values: dict[Any, Any] = dict(zip(jaxpr.invars, inputs, strict=True))
    values.update(zip(jaxpr.constvars, map(constant, constants), strict=True))

    def read(variable: Any) -> Any:
        return constant(variable.val) if isinstance(variable, Literal) else values[variable]

    for equation in jaxpr.eqns:
        results = apply(equation, [read(each) for each in equation.invars])
        values.update(zip(equation.outvars, results, strict=True))
    return [read(each) for each in jaxpr.outvars]
