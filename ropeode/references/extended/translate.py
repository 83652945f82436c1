"""A problem's right-hand side as heyoka's expressions, so that any precision can solve it."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from typing import Any

import jax
import numpy as np

from ropeode.errors import InputError
from ropeode.precision import in_float64
from ropeode.problems.problem import Problem
from ropeode.references.extended import heyoka, rules
from ropeode.references.extended.entries import CHOICES
from ropeode.references.extended.guards import Guards, chooses, chosen
from ropeode.references.extended.jaxprs import Value, bind, is_float, walk


@dataclasses.dataclass(frozen=True, eq=False)
class Translation:
    """A right-hand side as expressions.

    Arguments:
        variables: one for each component of the flattened state.
        derivatives: one expression for each of them; time is `heyoka.time`.
        guards: the choices that the expressions take for granted.
    """

    variables: list[Any]
    derivatives: list[Any]
    guards: Guards

    @property
    def system(self) -> list[tuple[Any, Any]]:
        """What `heyoka.taylor_adaptive` takes."""
        return list(zip(self.variables, self.derivatives, strict=True))


@in_float64
def translate(
    problem: Problem, precision: int, *, t: float | None = None, y: np.ndarray | None = None
) -> Translation:
    """Translate a problem's right-hand side, primitive by primitive.

    The numbers in it are the binary64 numbers that the problem holds, without any further
    rounding. What is computed from them alone is computed in `precision` and 64 bits more.
    Where the right-hand side chooses by looking at the state, the branch just after the start
    is taken; `guards` tells whether another state would choose alike.

    Arguments:
        problem: whose right-hand side.
        precision: of the solution that is wanted, in bits.
        t: where the solution starts, if not at the first sample time.
        y: the state there.

    Raises:
        InputError: the right-hand side has a primitive that cannot be translated, or heyoka
            is missing.
    """
    library = heyoka()
    start = float(problem.ts[0]) if t is None else t
    state = problem.y0 if y is None else np.asarray(y, dtype=np.float64)
    traced = jax.make_jaxpr(problem.rhs)(start, state, problem.args)
    guards = Guards(problem, traced, start, state)
    symbols = _Symbols(precision + rules.GUARD_BITS, iter(guards.choices))
    variables = [library.expression(f"y{i}") for i in range(state.size)]
    inputs = [
        Value(rules.objects((), [library.time]), True),
        Value(rules.objects(state.shape, variables), True),
        *(Value(symbols.constant(leaf), False) for leaf in jax.tree.leaves(problem.args)),
    ]
    (result,) = walk(traced, inputs, symbols)
    return Translation(
        variables, [library.expression(entry) for entry in result.content.flat], guards
    )


class _Symbols:
    """Arrays of expressions and constants; of plain numbers where they are not floats.

    Arguments:
        bits: of the constants.
        choices: in the order in which the primitives make them.
    """

    def __init__(self, bits: int, choices: Iterator[np.ndarray]):
        self.bits = bits
        self.choices = choices

    def constant(self, array: Any) -> np.ndarray:
        array = np.asarray(array)
        return rules.constants(array, self.bits) if array.dtype.kind == "f" else array

    def apply(self, equation: Any, inputs: Sequence[Value]) -> list[np.ndarray]:
        name = equation.primitive.name
        contents = [value.content for value in inputs]
        if name in ("optimization_barrier", "stop_gradient"):
            return contents
        choosing = chooses(equation, inputs)
        choice = next(self.choices) if choosing else None
        outputs = equation.outvars
        if not any(is_float(output) for output in outputs):
            if choosing:
                return [np.asarray(choice)]
            numbers = [self._numbers(name, content) for content in contents]
            return [np.asarray(result) for result in bind(equation, numbers)]
        for output in outputs:
            if output.aval.dtype != np.float64:
                _refuse(name, f" with results in {output.aval.dtype}")
        if name == "convert_element_type":
            (array,) = contents
            return [array if array.dtype == object else rules.constants(array, self.bits)]
        if name == "iota":
            return [rules.constants(bind(equation, [])[0], self.bits)]
        if name in rules.MOVES:
            results = rules.moved(equation, contents)
            return _refuse(name, " with an index outside the array") if results is None else results
        if name == "scatter-add":
            return [rules.scatter_add(equation, *contents)]
        if name in CHOICES or name in rules.STEPS:
            if not choosing:
                numbers = [self._numbers(name, content) for content in contents]
                choice = chosen(equation, numbers, bind(equation, numbers))
            return [rules.by_choice(name, np.asarray(choice), contents, self.bits)]
        if name in rules.RULES:
            exact = [c if c.dtype == object else rules.constants(c, self.bits) for c in contents]
            return [rules.RULES[name](equation.params, *exact)]
        return _refuse(name)

    def _numbers(self, name: str, content: np.ndarray) -> np.ndarray:
        if content.dtype != object:
            return content
        if any(isinstance(entry, heyoka().expression) for entry in content.flat):
            _refuse(name, " on what depends on the state")
        return rules.floats(content)


def _refuse(name: str, how: str = "") -> Any:
    supported = sorted({*rules.RULES, *rules.MOVES, *CHOICES, *rules.STEPS, "scan", "scatter-add"})
    raise InputError(
        f"rhs: uses the JAX primitive {name!r}{how}, which cannot be computed in extended "
        f"precision; allowed: {', '.join(supported)}, in float64. Fix: write it with these, or use "
        "a reference of level 'consensus'."
    )
