"""Arithmetic of exact constants and of heyoka's expressions, one number at a time.

A constant is a `heyoka.real` with guard bits. Arithmetic of constants is left to MPFR: heyoka
would do it in the precision of a constant, and that of a float is float64.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ropeode.references.extended import heyoka


def _is_constant(entry: Any) -> bool:
    return not isinstance(entry, heyoka().expression)


def _is_zero(entry: Any) -> bool:
    return _is_constant(entry) and bool(entry == 0)


def add(a: Any, b: Any) -> Any:
    """The sum of two numbers or expressions."""
    return b if _is_zero(a) else a if _is_zero(b) else a + b


def subtract(a: Any, b: Any) -> Any:
    """Their difference."""
    return a if _is_zero(b) else -b if _is_zero(a) else a - b


def multiply(a: Any, b: Any) -> Any:
    """Their product; zero where one of them is."""
    return a if _is_zero(a) else b if _is_zero(b) else a * b


def divide(a: Any, b: Any) -> Any:
    """Their quotient."""
    return a if _is_zero(a) and not _is_zero(b) else a / b


def power(base: Any, exponent: Any) -> Any:
    """A power with any exponent."""
    expression = heyoka().expression
    if not _is_constant(exponent):
        return expression(base) ** exponent
    if _is_constant(base):
        return base**exponent
    # Whole and half exponents as floats: heyoka looks for these.
    plain = float(exponent)
    return base**plain if exponent == plain else base ** expression(exponent)


def total(entries: Sequence[Any]) -> Any:
    """The sum of numbers and expressions, of which there may be none."""
    library = heyoka()
    constant = sum((entry for entry in entries if _is_constant(entry)), start=library.real(0, 53))
    moving = [entry for entry in entries if not _is_constant(entry)]
    if not moving:
        return constant
    if constant != 0:
        moving.append(library.expression(constant))
    return moving[0] if len(moving) == 1 else library.sum(moving)


def _function(of_constants: Callable[[Any], Any], name: str) -> Callable[[Any], Any]:
    def function(entry: Any) -> Any:
        return of_constants(entry) if _is_constant(entry) else getattr(heyoka(), name)(entry)

    return function


def _log1p(entry: Any) -> Any:
    return np.log1p(entry) if _is_constant(entry) else heyoka().log(1.0 + entry)


def _logistic(entry: Any) -> Any:
    return 1.0 / (1.0 + np.exp(-entry)) if _is_constant(entry) else heyoka().sigmoid(entry)


def _exp2(entry: Any) -> Any:
    two = heyoka().real(2, 1024)
    return np.exp2(entry) if _is_constant(entry) else heyoka().exp(np.log(two) * entry)


def _atan2(y: Any, x: Any) -> Any:
    if _is_constant(y) and _is_constant(x):
        return np.arctan2(y, x)
    library = heyoka()
    return library.atan2(library.expression(y), library.expression(x))


def _error_function(name: str) -> Callable[[Any], Any]:
    return lambda entry: getattr(heyoka(), name)(heyoka().expression(entry))


# Primitives that do the same with each number.
OF_ONE: dict[str, Callable[[Any], Any]] = {
    "neg": lambda entry: -entry,
    "square": lambda entry: entry**2.0,
    "rsqrt": lambda entry: entry**-0.5,
    "sqrt": _function(np.sqrt, "sqrt"),
    "exp": _function(np.exp, "exp"),
    "exp2": _exp2,
    "expm1": _function(np.expm1, "expm1"),
    "log": _function(np.log, "log"),
    "log1p": _log1p,
    "sin": _function(np.sin, "sin"),
    "cos": _function(np.cos, "cos"),
    "tan": _function(np.tan, "tan"),
    "asin": _function(np.arcsin, "asin"),
    "acos": _function(np.arccos, "acos"),
    "atan": _function(np.arctan, "atan"),
    "sinh": _function(np.sinh, "sinh"),
    "cosh": _function(np.cosh, "cosh"),
    "tanh": _function(np.tanh, "tanh"),
    "asinh": _function(np.arcsinh, "asinh"),
    "acosh": _function(np.arccosh, "acosh"),
    "atanh": _function(np.arctanh, "atanh"),
    "logistic": _logistic,
    "erf": _error_function("erf"),
    "erfc": _error_function("erfc"),
}
OF_TWO: dict[str, Callable[[Any, Any], Any]] = {
    "add": add,
    "add_any": add,
    "sub": subtract,
    "mul": multiply,
    "div": divide,
    "pow": power,
    "atan2": _atan2,
}


def _absolute(choice: Any, entry: Any) -> Any:
    return entry if choice else -entry


def _cube_root(choice: Any, entry: Any) -> Any:
    if _is_constant(entry):
        return np.cbrt(entry)
    # The bits of a constant that has them for every precision that is of use.
    third = heyoka().expression(heyoka().real(1, 4096) / 3)
    return entry**third if choice else -((-entry) ** third)


# Primitives that choose between smooth functions; the choice comes first.
CHOICES: dict[str, Callable[..., Any]] = {
    "abs": _absolute,
    "cbrt": _cube_root,
    "max": lambda choice, a, b: a if choice else b,
    "min": lambda choice, a, b: b if choice else a,
    "clamp": lambda choice, *branches: branches[int(choice)],
}
