"""What rounding may do to a function: each rounded number moved by a unit in the last place.

All float64 solvers evaluate the same right-hand side, and what it loses to rounding, they lose
alike: ``(1.0 + 1e-17) - 1.0`` is zero for each of them. Here a function is evaluated twice in step:
as it is, and with each rounded result moved, up or down. How far the two are apart shows what
rounding may do (stochastic arithmetic; Vignes, A stochastic arithmetic for reliable scientific
computation, Mathematics and Computers in Simulation 35, 1993).

The direction is a hash of the result's own bits and of the operation's place in the program. So
what is computed once more from the same numbers is moved in the same way: a constant loss stays
constant, as it does in real rounding, and what varies is moved at random. Choices (comparisons,
whole parts, the length of loops) are those of the function as it is, so that a table is read where
it is read, and an iteration ends where it ends. Only a comparison of equal numbers is open.
"""

from __future__ import annotations

import zlib
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax
from jax.extend.core import jaxpr_as_fun

from ropeode.problems.nested_jaxprs import evaluated, inside, split_scan

_EPS = np.finfo(np.float64).eps
_ONE, _HALF, _MANTISSA = np.uint64(1), np.uint64(2**63), np.uint64(2**52 - 1)
# Odd numbers without a pattern, those of the hash functions splitmix64 and murmur3.
_SPREAD, _MIX = np.uint64(0x9E3779B97F4A7C15), np.uint64(0xC4CEB9FE1A85EC53)


def _names(text: str) -> frozenset[str]:
    return frozenset(text.split())


# Primitives whose results are among their inputs, or exact.
_EXACT = _names(
    """
    abs broadcast_in_dim clamp complex concatenate conj copy copy_p cummax cummin
    dynamic_slice dynamic_update_slice expand_dims gather imag iota max min neg
    optimization_barrier pad real reduce_max reduce_min reduce_precision reduce_window_max
    reduce_window_min reshape rev scatter scatter-max scatter-min select_n slice sort split
    squeeze stack stop_gradient tile top_k transpose unstack
    """
)
# Primitives whose results jump where an input crosses a number, and of these the comparisons.
_COMPARISONS = _names(
    """
    eq ge gt le lt ne sign
    """
)
_CHOICES = _names(
    """
    argmax argmin bitcast_convert_type ceil convert_element_type floor is_finite nextafter
    round
    """
)
# Primitives whose results are right up to their own rounding, whatever the inputs are.
_ROUNDED = _names(
    """
    acos acosh asin asinh atan atan2 atanh cbrt cos cosh cumprod erf erfc exp exp2 expm1
    integer_pow log log1p log2 logistic one_minus_square pow reduce_prod rsqrt sin sinh sqrt
    square tan tanh
    """
)
# Primitives that add many numbers: what is lost is a part of the largest, not of the result.
_SUMS = _names(
    """
    conv_general_dilated cumsum dot_general reduce_sum reduce_window_sum scatter-add
    scatter-sub
    """
)
# Primitives that call another traced function with their own inputs.
CALLS = _names(
    """
    checkpoint closed_call core_call custom_jvp_call custom_vjp_call custom_vjp_call_jaxpr
    jit pjit remat2
    """
)


def change_by_rounding(function: Callable, y: Any, seed: Any) -> Any:
    """How far a function's value moves when its input and all that it rounds move by a unit.

    Arguments:
        function: takes and returns an array.
        y: where to evaluate it.
        seed: a whole number; others give other directions. An even one turns every second
            direction of the odd one before it, so that two equal losses of which one is
            subtracted from the other do not hide from both.

    Returns:
        An array of the shape of the function's; zero where the change is not finite, as at the
        edge of the domain of a root.
    """
    salt = _Salt.of(seed)
    # Two units in the run that turns directions: an even function of the state sees no turn.
    units = _ONE + (salt.turns >> np.uint64(63))
    start = Pair(y, _moved(y, salt.at("input"), units=units))
    (value,) = _evaluated(jax.make_jaxpr(function)(y), salt, [start])
    change = lax.sub(value.moved, value.plain)
    return jnp.where(jnp.isfinite(change), change, 0.0)


def change_if_asked(function: Callable, y: Any, seed: Any) -> Any:
    """`change_by_rounding` where the seed is not 0; nothing where it is."""
    return lax.cond(
        seed > 0, lambda y: change_by_rounding(function, y, seed), lambda y: jnp.zeros_like(y), y
    )


class Pair(NamedTuple):
    """What a variable of the traced function holds.

    Fields:
        plain: its value.
        moved: its value with all roundings before it moved; the same object where there are none.
    """

    plain: Any
    moved: Any


class _Salt(NamedTuple):
    """What makes the directions of one operation differ from those of another.

    Fields:
        true: traced; always true, which XLA does not know.
        run: a traced number of the seed and of the rounds of the loops around.
        turns: traced; the first bit is set where every second direction is turned.
        order: which of these it is.
        place: a number of the operation.
        counts: how many operations of each kind there were before.
    """

    true: Any
    run: Any
    turns: Any
    order: Any
    place: int
    counts: Counter[str]

    @classmethod
    def of(cls, seed: Any) -> _Salt:
        """That of the whole function."""
        seed = lax.convert_element_type(seed, np.uint64)
        turns = ((seed & _ONE) ^ _ONE) << np.uint64(63)
        return cls(seed < _HALF, _hashed((seed + _ONE) >> _ONE), turns, np.uint64(0), 0, Counter())

    def at(self, kind: str) -> _Salt:
        """That of the next operation of a kind."""
        count = self.counts[kind]
        self.counts[kind] += 1
        place = zlib.crc32(kind.encode()) + (count << 32)
        return self._replace(place=place, order=self.order + np.uint64(count))

    def in_round(self, count: Any) -> _Salt:
        """That of one round of a loop."""
        count = lax.convert_element_type(count, np.uint64)
        return self._replace(run=_hashed(self.run + count), order=self.order + count)


def _evaluated(traced: Any, salt: _Salt, inputs: Sequence[Pair]) -> list[Pair]:
    """The results of a jaxpr, closed or without constants."""

    def apply(equation: Any, inputs: list[Pair]) -> Sequence[Pair]:
        return _applied(equation, salt, inputs)

    return evaluated(traced, inputs, apply, lambda constant: Pair(constant, constant))


def _applied(equation: Any, salt: _Salt, inputs: list[Pair]) -> Sequence[Pair]:
    """The results of one primitive."""
    name = equation.primitive.name
    if name in CALLS:
        return _evaluated(inside(equation)[0], salt, inputs)
    if name in _LOOPS:
        return _LOOPS[name](equation, salt, inputs)
    plain = _bound(equation, [each.plain for each in inputs])
    same = all(each.moved is each.plain for each in inputs)
    if _is_exact(equation):
        moved = plain if same else _bound(equation, [each.moved for each in inputs])
    elif name in _CHOICES or (same and name in _COMPARISONS):
        moved = plain
    else:
        moved = _moved_results(equation, salt.at(name), plain, inputs)
    return [Pair(*each) for each in zip(plain, moved, strict=True)]


def _moved_results(
    equation: Any, salt: _Salt, plain: list[Any], inputs: list[Pair]
) -> Sequence[Any]:
    """The results of a primitive that rounds, on moved inputs, and moved in turn."""
    name, changed = equation.primitive.name, [each.moved for each in inputs]
    if name in _RULES and _is_float(plain[0]):
        return [_RULES[name](salt, *changed)]
    if name == "rem":
        # So many whole turns as without moves.
        (a, b), (rest,) = inputs, plain
        return [a.moved - jnp.round((a.plain - rest) / b.plain) * b.moved]
    if name not in _COMPARISONS | _ROUNDED | _SUMS | _RULES.keys():
        # All that is known of it: right for inputs close by.
        changed = [_moved(each, salt.at("input")) for each in changed]
    results = _bound(equation, changed)
    if name in _COMPARISONS:
        first, second = (*(each.plain for each in inputs), 0)[:2]
        return [jnp.where(first == second, results[0], plain[0])]
    if name in _SUMS:
        (size,) = _bound(equation, [_size(each) for each in changed])
        return [results[0] + _signs(results[0], salt) * (_EPS * size)]
    return [_moved(each, salt) for each in results]


def _is_exact(equation: Any) -> bool:
    """Whether a primitive neither rounds nor chooses."""
    kinds = [
        jnp.issubdtype(variable.aval.dtype, np.inexact)
        for variable in (*equation.invars, *equation.outvars)
    ]
    if equation.primitive.name == "convert_element_type":
        return kinds[0] == kinds[1]
    return equation.primitive.name in _EXACT or not any(kinds)


def _bound(equation: Any, inputs: Sequence[Any]) -> list[Any]:
    results = equation.primitive.bind(*inputs, **equation.params)
    return list(results) if equation.primitive.multiple_results else [results]


def _sum(salt: _Salt, a: Any, b: Any) -> Any:
    """A sum, moved if rounding takes something from it."""
    # XLA would simplify what follows for a constant.
    a, b = (jnp.where(salt.true, each, 0.0) for each in (a, b))
    total = a + b
    from_b = total - a
    lost = (a - (total - from_b)) + (b - from_b)
    return _moved(total, salt, where=lost != 0)


# Of sums it is known whether they are exact; so are products with powers of two.
_RULES: dict[str, Callable] = {
    "add": _sum,
    "add_any": _sum,
    "sub": lambda salt, a, b: _sum(salt, a, -b),
    "mul": lambda salt, a, b: _moved(a * b, salt, where=~(_is_power(a) | _is_power(b))),
    "div": lambda salt, a, b: _moved(a / b, salt, where=~_is_power(b)),
}


def _cond(equation: Any, salt: _Salt, inputs: list[Pair]) -> Sequence[Pair]:
    which, *inputs = inputs

    def branch(traced: Any) -> Callable:
        return lambda inputs: _evaluated(traced, salt, inputs)

    branches = [branch(traced) for traced in equation.params["branches"]]
    return lax.switch(which.plain, branches, inputs)


def _while(equation: Any, salt: _Salt, inputs: list[Pair]) -> Sequence[Pair]:
    params = equation.params
    outside, before = params["cond_nconsts"], params["cond_nconsts"] + params["body_nconsts"]
    goes_on = jaxpr_as_fun(params["cond_jaxpr"])
    asked = [each.plain for each in inputs[:outside]]

    def again(state: Any) -> Any:
        _, pairs = state
        return goes_on(*asked, *(each.plain for each in pairs))[0]

    def body(state: Any) -> Any:
        count, pairs = state
        inner = [*inputs[outside:before], *pairs]
        return count + 1, _evaluated(params["body_jaxpr"], salt.in_round(count), inner)

    return lax.while_loop(again, body, (jnp.asarray(0), list(inputs[before:])))[1]


def _scan(equation: Any, salt: _Salt, inputs: list[Pair]) -> Sequence[Pair]:
    params = equation.params
    constants, start, rows = split_scan(equation, inputs)

    def body(state: Any, rows: list[Pair]) -> Any:
        count, pairs = state
        inner = [*constants, *pairs, *rows]
        results = _evaluated(params["jaxpr"], salt.in_round(count), inner)
        return (count + 1, results[: len(pairs)]), results[len(pairs) :]

    more = {name: params[name] for name in ("length", "reverse", "unroll")}
    (_, last), stacks = lax.scan(body, (jnp.asarray(0), start), rows, **more)
    return [*last, *stacks]


_LOOPS: dict[str, Callable] = {"cond": _cond, "while": _while, "scan": _scan}


def _moved(x: Any, salt: _Salt, where: Any = True, units: Any = _ONE) -> Any:
    """Numbers moved by units in the last place, where that is asked for."""
    if jnp.iscomplexobj(x):
        return lax.complex(_moved(lax.real(x), salt, where), _moved(lax.imag(x), salt, where))
    if not _is_float(x):
        return x
    bits = lax.bitcast_convert_type(x, np.uint64)
    next_bits = jnp.where(_up(bits, salt), bits + units, bits - units)
    stays = (x == 0.0) | ~(jnp.abs(x) < np.inf)
    return jnp.where(where & ~stays, lax.bitcast_convert_type(next_bits, np.float64), x)


def _signs(x: Any, salt: _Salt) -> Any:
    """1 or -1 for each number; for complex numbers one for both parts."""
    bits = lax.bitcast_convert_type(lax.real(x) if jnp.iscomplexobj(x) else x, np.uint64)
    return jnp.where(_up(bits, salt), 1.0, -1.0)


def _up(bits: Any, salt: _Salt) -> Any:
    """A coin for each number, by its bits, its place in the array, and the salt."""
    salted, order = bits ^ (salt.run + np.uint64(salt.place)), salt.order
    if bits.size > 1:
        index = lax.iota(np.uint64, bits.size).reshape(bits.shape)
        salted, order = salted + index * _SPREAD, order + index
    return (_hashed(salted) ^ (salt.turns & (order << np.uint64(63)))) < _HALF


def _hashed(bits: Any) -> Any:
    """A hash, of which the first bits are good."""
    bits = lax.convert_element_type(bits, np.uint64) * _SPREAD
    return (bits ^ (bits >> np.uint64(32))) * _MIX


def _is_power(x: Any) -> Any:
    """Whether a number is zero, or plus or minus a power of two."""
    return lax.bitcast_convert_type(jnp.asarray(x), np.uint64) & _MANTISSA == 0


def _is_float(x: Any) -> bool:
    return jnp.result_type(x) == np.float64


def _size(x: Any) -> Any:
    return x if jnp.issubdtype(jnp.result_type(x), np.integer) else jnp.abs(x)
