"""Arithmetic of exact constants and of heyoka's expressions, and arrays of them.

A constant is a `heyoka.real` with guard bits. Arithmetic of constants is left to MPFR: heyoka
would do it in the precision of a constant, and that of a float is float64. A complex number is a
pair of these.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from ropeode.references.extended import heyoka

# Whole powers up to this one are products, which have a Taylor series at zero too.
_MOST_FACTORS = 256
# The bits of constants of our own, which serve every precision that is of use.
_BITS = 4096


class Complex(NamedTuple):
    """A complex number.

    Fields:
        re: its real part, a constant or an expression.
        im: its imaginary part.
    """

    re: Any
    im: Any


def _parts(entry: Any) -> Complex:
    return entry if isinstance(entry, Complex) else Complex(entry, heyoka().real(0, 53))


def is_constant(entry: Any) -> bool:
    """Whether a number depends on neither the state nor the time."""
    if isinstance(entry, Complex):
        return is_constant(entry.re) and is_constant(entry.im)
    return not isinstance(entry, heyoka().expression)


def _is_zero(entry: Any) -> bool:
    return not isinstance(entry, Complex) and is_constant(entry) and bool(entry == 0)


def add(a: Any, b: Any) -> Any:
    """The sum of two numbers or expressions."""
    if isinstance(a, Complex) or isinstance(b, Complex):
        p, q = _parts(a), _parts(b)
        return Complex(add(p.re, q.re), add(p.im, q.im))
    return b if _is_zero(a) else a if _is_zero(b) else a + b


def negative(a: Any) -> Any:
    """The number with the other sign."""
    return Complex(negative(a.re), negative(a.im)) if isinstance(a, Complex) else -a


def subtract(a: Any, b: Any) -> Any:
    """Their difference."""
    if isinstance(a, Complex) or isinstance(b, Complex):
        return add(a, negative(b))
    return a if _is_zero(b) else -b if _is_zero(a) else a - b


def multiply(a: Any, b: Any) -> Any:
    """Their product; zero where one of them is."""
    if isinstance(a, Complex) or isinstance(b, Complex):
        p, q = _parts(a), _parts(b)
        return Complex(
            subtract(multiply(p.re, q.re), multiply(p.im, q.im)),
            add(multiply(p.re, q.im), multiply(p.im, q.re)),
        )
    return a if _is_zero(a) else b if _is_zero(b) else a * b


def divide(a: Any, b: Any) -> Any:
    """Their quotient."""
    if isinstance(b, Complex):
        return divide(multiply(a, conjugate(b)), _squared_modulus(b))
    if isinstance(a, Complex):
        return Complex(divide(a.re, b), divide(a.im, b))
    return a if _is_zero(a) and not _is_zero(b) else a / b


def conjugate(a: Any) -> Any:
    """The complex conjugate."""
    return Complex(a.re, negative(a.im)) if isinstance(a, Complex) else a


def _squared_modulus(a: Complex) -> Any:
    return add(multiply(a.re, a.re), multiply(a.im, a.im))


def whole_power(base: Any, exponent: int) -> Any:
    """A power by multiplication, which is smooth where the base is zero."""
    if exponent < 0:
        return divide(heyoka().real(1, 53), whole_power(base, -exponent))
    if exponent == 0:
        return heyoka().real(1, 53)
    if exponent == 2 and not isinstance(base, Complex):
        return base * base if is_constant(base) else base**2.0
    half = whole_power(base, exponent // 2) if exponent > 1 else None
    if half is None:
        return base
    square = whole_power(half, 2) if not isinstance(half, Complex) else multiply(half, half)
    return multiply(square, base) if exponent % 2 else square


def power(base: Any, exponent: Any) -> Any:
    """A power of a real number with any exponent."""
    expression = heyoka().expression
    if not is_constant(exponent):
        return expression(base) ** exponent
    plain = float(exponent)
    if plain == exponent and plain.is_integer() and abs(plain) <= _MOST_FACTORS:
        return whole_power(base, int(plain))
    if is_constant(base):
        return base**exponent
    # Half exponents as floats: heyoka looks for these.
    return base**plain if exponent == plain else base ** expression(exponent)


def total(entries: Sequence[Any]) -> Any:
    """The sum of numbers and expressions, of which there may be none."""
    library = heyoka()
    if any(isinstance(entry, Complex) for entry in entries):
        parts = [_parts(entry) for entry in entries]
        return Complex(total([part.re for part in parts]), total([part.im for part in parts]))
    constant = sum((entry for entry in entries if is_constant(entry)), start=library.real(0, 53))
    moving = [entry for entry in entries if not is_constant(entry)]
    if not moving:
        return constant
    if constant != 0:
        moving.append(library.expression(constant))
    return moving[0] if len(moving) == 1 else library.sum(moving)


def root_of_unity(turns: int, size: int, bits: int) -> Complex:
    """The complex number of modulus 1 whose angle is a part, ``turns / size``, of a full turn."""
    angle = 8 * np.arctan(heyoka().real(1, bits)) * (turns % size) / size
    return Complex(np.cos(angle), np.sin(angle))


def _function(of_constants: Callable[[Any], Any], name: str) -> Callable[[Any], Any]:
    def function(entry: Any) -> Any:
        return of_constants(entry) if is_constant(entry) else getattr(heyoka(), name)(entry)

    return function


def _logistic(entry: Any) -> Any:
    return 1.0 / (1.0 + np.exp(-entry)) if is_constant(entry) else heyoka().sigmoid(entry)


def _exp2(entry: Any) -> Any:
    two = heyoka().real(2, _BITS)
    return np.exp2(entry) if is_constant(entry) else exp(np.log(two) * entry)


def _log2(entry: Any) -> Any:
    return np.log2(entry) if is_constant(entry) else _log(entry) / np.log(heyoka().real(2, _BITS))


def _one_minus_square(entry: Any) -> Any:
    one = heyoka().real(1, 53)
    return multiply(add(one, entry), subtract(one, entry))


def horner(entry: Any, *coefficients: Any) -> Any:
    """A polynomial, with its coefficients from the constant one on."""
    result, *others = reversed(coefficients)
    for coefficient in others:
        result = add(multiply(result, entry), coefficient)
    return result


def _error_function(name: str) -> Callable[[Any], Any]:
    return lambda entry: getattr(heyoka(), name)(heyoka().expression(entry))


exp, _log = _function(np.exp, "exp"), _function(np.log, "log")
_sin, _cos = _function(np.sin, "sin"), _function(np.cos, "cos")
_sinh, _cosh = _function(np.sinh, "sinh"), _function(np.cosh, "cosh")
_sqrt = _function(np.sqrt, "sqrt")

# Primitives that do the same with each real number.
OF_ONE: dict[str, Callable[[Any], Any]] = {
    "neg": negative,
    "square": lambda entry: whole_power(entry, 2),
    "rsqrt": lambda entry: entry**-0.5,
    "sqrt": _sqrt,
    "exp": exp,
    "exp2": _exp2,
    "expm1": _function(np.expm1, "expm1"),
    "log": _log,
    "log1p": _function(np.log1p, "log1p"),
    "log2": _log2,
    "one_minus_square": _one_minus_square,
    "sin": _sin,
    "cos": _cos,
    "tan": _function(np.tan, "tan"),
    "asin": _function(np.arcsin, "asin"),
    "acos": _function(np.arccos, "acos"),
    "atan": _function(np.arctan, "atan"),
    "sinh": _sinh,
    "cosh": _cosh,
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
    "complex": Complex,
}


def _complex_exp(z: Complex) -> Complex:
    size = exp(z.re)
    return Complex(multiply(size, _cos(z.im)), multiply(size, _sin(z.im)))


def _complex_sinh(z: Complex) -> Complex:
    return Complex(multiply(_sinh(z.re), _cos(z.im)), multiply(_cosh(z.re), _sin(z.im)))


def _complex_cosh(z: Complex) -> Complex:
    return Complex(multiply(_cosh(z.re), _cos(z.im)), multiply(_sinh(z.re), _sin(z.im)))


def _turned(z: Complex) -> Complex:
    """The number times i."""
    return Complex(negative(z.im), z.re)


def _modulus(z: Complex) -> Any:
    return _sqrt(_squared_modulus(z))


# The same for complex numbers.
OF_ONE_COMPLEX: dict[str, Callable[[Any], Any]] = {
    "neg": negative,
    "square": lambda z: multiply(z, z),
    "one_minus_square": _one_minus_square,
    "conj": conjugate,
    "real": lambda z: _parts(z).re,
    "imag": lambda z: _parts(z).im,
    "abs": _modulus,
    "sign": lambda z: divide(z, _modulus(z)),
    "exp": _complex_exp,
    "sinh": _complex_sinh,
    "cosh": _complex_cosh,
    "tanh": lambda z: divide(_complex_sinh(z), _complex_cosh(z)),
    "cos": lambda z: _complex_cosh(_turned(z)),
    "sin": lambda z: negative(_turned(_complex_sinh(_turned(z)))),
    "tan": lambda z: negative(
        _turned(divide(_complex_sinh(_turned(z)), _complex_cosh(_turned(z))))
    ),
}


def _absolute(choice: Any, entry: Any) -> Any:
    return entry if choice else -entry


def _cube_root(choice: Any, entry: Any) -> Any:
    if is_constant(entry):
        return np.cbrt(entry)
    third = heyoka().expression(heyoka().real(1, _BITS) / 3)
    return entry**third if choice else -((-entry) ** third)


def _angle(choice: Any, y: Any, x: Any) -> Any:
    """The angle of a point, without its jump on the negative half of the x axis.

    Where the choice says that it begins above that axis, it jumps on the negative half of the y
    axis; else on the positive one.
    """
    if is_constant(y) and is_constant(x):
        return np.arctan2(y, x)
    library = heyoka()
    y, x = library.expression(y), library.expression(x)
    quarter = library.expression(2 * np.arctan(library.real(1, _BITS)))
    return quarter + library.atan2(-x, y) if choice > 0 else library.atan2(x, -y) - quarter


def _complex_log(choice: Any, z: Complex) -> Complex:
    return Complex(
        multiply(heyoka().real(0.5, 53), _log(_squared_modulus(z))), _angle(choice, z.im, z.re)
    )


def _complex_power(choice: Any, z: Complex, exponent: Any) -> Complex:
    return _complex_exp(multiply(exponent, _complex_log(choice, z)))


# Primitives that choose between smooth functions; the choice comes first.
CHOICES: dict[str, Callable[..., Any]] = {
    "abs": _absolute,
    "cbrt": _cube_root,
    "atan2": _angle,
    "max": lambda choice, a, b: a if choice else b,
    "min": lambda choice, a, b: b if choice else a,
    "clamp": lambda choice, *branches: branches[int(choice)],
    "rem": lambda choice, a, b: subtract(a, multiply(heyoka().real(float(choice), 53), b)),
}
# The same for complex numbers, which choose between branches.
CHOICES_COMPLEX: dict[str, Callable[..., Any]] = {
    "log": _complex_log,
    "log2": lambda choice, z: divide(_complex_log(choice, z), np.log(heyoka().real(2, _BITS))),
    "sqrt": lambda choice, z: _complex_power(choice, z, heyoka().real(0.5, 53)),
    "rsqrt": lambda choice, z: _complex_power(choice, z, heyoka().real(-0.5, 53)),
    "pow": _complex_power,
}


# Arrays of them.


def constants(array: Any, bits: int) -> np.ndarray:
    """Numbers, without any rounding where `bits` is 53 or more."""
    real, array = heyoka().real, np.asarray(array)
    if array.dtype.kind == "c":
        parts = zip(np.ravel(array.real).tolist(), np.ravel(array.imag).tolist(), strict=True)
        return objects(array.shape, (Complex(real(re, bits), real(im, bits)) for re, im in parts))
    numbers = array.astype(np.float64).ravel().tolist()
    return objects(array.shape, (real(number, bits) for number in numbers))


def objects(shape: Sequence[int], entries: Iterable[Any]) -> np.ndarray:
    """An array of objects; NumPy would make one of numbers where all are constants."""
    listed = list(entries)
    array = np.empty(len(listed), dtype=object)
    for i, entry in enumerate(listed):
        array[i] = entry
    return array.reshape(tuple(shape))


def floats(array: np.ndarray, dtype: Any) -> np.ndarray:
    """Constants, rounded to float64.

    Arguments:
        array: of constants.
        dtype: of the result, real or complex.
    """
    numbers = [
        complex(float(entry.re), float(entry.im)) if isinstance(entry, Complex) else float(entry)
        for entry in array.flat
    ]
    return np.array(numbers, dtype=dtype).reshape(array.shape)


def each(function: Callable[..., Any], *arrays: np.ndarray) -> np.ndarray:
    """A function of numbers on each of the entries."""
    shape = np.broadcast_shapes(*(array.shape for array in arrays))
    rows = (np.broadcast_to(array, shape).flat for array in arrays)
    return objects(shape, (function(*entry) for entry in zip(*rows, strict=True)))
