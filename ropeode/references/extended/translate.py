"""A problem's right-hand side as heyoka's expressions, so that any precision can solve it."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ropeode.precision import in_float64
from ropeode.problems import Problem
from ropeode.references.extended import heyoka, rules
from ropeode.references.extended.entries import OF_ONE, OF_ONE_COMPLEX, constants, floats, objects
from ropeode.references.extended.guards import Guards, chooses, just_after, looked_at, traced_once
from ropeode.references.extended.jaxprs import Value, bind, is_complex, is_float, refuse, walk

# Bits that constants have beyond the precision of the solution.
_GUARD_BITS = 64
# Another choice is tried at so many states; and so many choices at most.
_TRIES, _MOST_OTHERS = 6, 24


@dataclasses.dataclass(frozen=True, eq=False)
class Translation:
    """A right-hand side as expressions.

    Arguments:
        problem: whose right-hand side.
        traced: the right-hand side as a jaxpr.
        bits: of its constants.
        guards: the choices that the expressions take for granted.
        variables: one for each component of the flattened state.
        derivatives: one expression for each of them; time is `heyoka.time`.
    """

    problem: Problem
    traced: Any
    bits: int
    guards: Guards
    variables: list[Any]
    derivatives: list[Any]
    others: dict[Any, bool] = dataclasses.field(default_factory=dict, repr=False)

    @property
    def system(self) -> list[tuple[Any, Any]]:
        """What `heyoka.taylor_adaptive` takes."""
        return list(zip(self.variables, self.derivatives, strict=True))

    def compiled(self, expressions: Sequence[Any], **kind: Any) -> Any:
        """Expressions as a function of many states and times.

        Arguments:
            expressions: in the variables and the time.
            kind: what heyoka calls the numbers.
        """
        return heyoka().cfunc(expressions, self.variables, compact_mode=True, **kind)

    def first_break(self, ts: Sequence[float], states: np.ndarray) -> tuple[int, str] | None:
        """The first state at which another function holds, and the primitive that chooses it.

        Another choice may make the same function: which rows a linear system exchanges does not
        matter to its solution.

        Arguments:
            ts: times.
            states: ``(times, *state)``.
        """
        for index, name in self.guards.breaks(ts, states):
            if not self._same_function(ts[index], states[index]):
                return index, name
        return None

    @in_float64
    def _same_function(self, t: float, y: np.ndarray) -> bool:
        """Whether the choices at a state make the same function, as far as the bits tell."""
        choices = self.guards.at(t, y)
        key = tuple(each.tobytes() for each in choices)
        if key not in self.others:
            if len(self.others) == _MOST_OTHERS:
                return False
            self.others[key] = self._agrees(_expressions(self, choices), t, y)
        return self.others[key]

    def _agrees(self, other: Sequence[Any], t: float, y: np.ndarray) -> bool:
        real = heyoka().real
        bits = 2 * self.bits
        both = self.compiled([*self.derivatives, *other], fp_type=real, prec=bits)
        draw = np.random.default_rng(7).normal(size=(_TRIES, y.size))
        states = y.reshape(-1) * (1.0 + 0.1 * draw) + 0.01 * self.problem.scale * draw[::-1]
        compared = 0
        for state in states:
            found = both(np.array([real(x, bits) for x in state]), time=real(t, bits))
            if not np.all(np.isfinite(found)):
                continue
            compared += 1
            limit = real(2.0**-self.bits, bits)
            for mine, others in zip(*np.split(found, 2), strict=True):
                if abs(mine - others) > limit * abs(mine):
                    return False
        return compared > _TRIES // 2


@in_float64
def translate(
    problem: Problem, precision: int, *, t: float | None = None, y: np.ndarray | None = None
) -> Translation:
    """Translate a problem's right-hand side, primitive by primitive.

    The numbers in it are the binary64 numbers that the problem holds, without any further
    rounding. What is computed from them alone is computed in `precision` and 64 bits more, or,
    where a primitive has no counterpart in extended precision (an eigenvalue, a random number),
    once by JAX: then its float64 result is such a number. Where the right-hand side chooses by
    looking at the state or the time, the branch just after the start is taken; `guards` tells
    whether another state would choose alike.

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
    traced = traced_once(problem)
    guards = Guards(problem, traced, *just_after(problem, start, state))
    translation = Translation(
        problem,
        traced,
        precision + _GUARD_BITS,
        guards,
        [library.expression(f"y{i}") for i in range(state.size)],
        [],
    )
    translation.derivatives.extend(_expressions(translation, guards.choices))
    return translation


def _expressions(translation: Translation, choices: Sequence[np.ndarray]) -> list[Any]:
    """The right-hand side for given choices, one expression for each component."""
    library, problem = heyoka(), translation.problem
    symbols = _Symbols(translation.bits, iter(choices))
    inputs = [
        Value(objects((), [library.time]), True),
        Value(objects(problem.y0.shape, translation.variables), True),
        *(Value(symbols.constant(leaf), False) for leaf in jax.tree.leaves(problem.args)),
    ]
    (result,) = walk(translation.traced, inputs, symbols)
    return [library.expression(entry) for entry in result.content.flat]


class _Symbols:
    """Arrays of expressions and constants; of plain numbers where they are not floats.

    Plain numbers that follow from the state or the time are not known (None): what comes of them
    is a choice.

    Arguments:
        bits: of the constants.
        choices: in the order in which the primitives make them.
    """

    def __init__(self, bits: int, choices: Iterator[np.ndarray]):
        self.bits = bits
        self.choices = choices

    def constant(self, array: Any) -> Any:
        if jnp.issubdtype(getattr(array, "dtype", np.float64), jax.dtypes.extended):
            return array
        array = np.asarray(array)
        return constants(array, self.bits) if array.dtype.kind in "fc" else array

    def decide(self, value: Value) -> np.ndarray:
        del value
        return np.asarray(next(self.choices))

    def stacked(self, rows: Sequence[Any], variable: Any) -> Any:
        if not rows:
            return self.constant(np.zeros(variable.aval.shape, variable.aval.dtype))
        return None if any(row is None for row in rows) else np.stack(rows)

    def apply(self, equation: Any, inputs: Sequence[Value]) -> list[Any]:
        contents = [value.content for value in inputs]
        outputs = equation.outvars
        moves = any(value.moves for value in inputs)
        if not any(is_float(output) for output in outputs):
            return [None] * len(outputs) if moves else self._bound(equation, contents)
        for i in looked_at(equation, inputs):
            contents[i] = np.asarray(next(self.choices))
        choice = np.asarray(next(self.choices)) if chooses(equation, inputs) else None
        name = equation.primitive.name
        exact = [content for content in contents if is_exact(content)]
        if not exact:
            return self._bound(equation, contents)
        if rules.choosing(equation):
            if choice is None:
                numbers = self._numbers(equation, contents)
                choice = np.asarray(rules.chosen(equation, numbers, bind(equation, numbers)))
            results = iter(rules.by_choice(equation, choice, exact, self.bits))
            known = None if moves else self._bound(equation, contents)
            return [
                next(results) if is_float(output) else None if known is None else known[i]
                for i, output in enumerate(outputs)
            ]
        results = self._translated(equation, contents)
        if results is not None:
            return results
        return refuse(name) if moves else self._bound(equation, contents)

    def _translated(self, equation: Any, contents: Sequence[Any]) -> list[Any] | None:
        """The results of a primitive that has a counterpart; None if it has none."""
        name = equation.primitive.name
        if name in ("optimization_barrier", "stop_gradient", "convert_element_type"):
            return list(contents)
        if name in rules.MOVES:
            return rules.moved(equation, contents, self.bits)
        if name in rules.SCATTERED:
            return [rules.scattered(equation, *contents)]
        if name == "conv_general_dilated":
            return [rules.convolution(equation, *contents)]
        of_complex = is_complex(equation.invars[0])
        if of_complex and name in OF_ONE_COMPLEX:
            return [rules.on_each(OF_ONE_COMPLEX[name])({}, *contents)]
        if name in rules.RULES and not (of_complex and name in OF_ONE):
            return [rules.RULES[name](equation.params, *contents)]
        return None

    def _bound(self, equation: Any, contents: Sequence[Any]) -> list[Any]:
        """What JAX computes from constants."""
        return [
            self.constant(result) for result in bind(equation, self._numbers(equation, contents))
        ]

    def _numbers(self, equation: Any, contents: Sequence[Any]) -> list[Any]:
        return [
            floats(content, variable.aval.dtype) if is_exact(content) else content
            for content, variable in zip(contents, equation.invars, strict=True)
        ]


def is_exact(content: Any) -> bool:
    """Whether it is an array of constants and expressions, and not of plain numbers."""
    return isinstance(content, np.ndarray) and content.dtype == object
