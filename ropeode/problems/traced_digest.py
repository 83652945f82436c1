"""What a traced function computes, as a short text: equal for equal programs."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from typing import Any

import jax
import numpy as np
from jax.extend.core import ClosedJaxpr, Jaxpr, Literal

# Their functions are there for derivatives, and say nothing of the values.
_WITH_DERIVATIVES = ("custom_jvp_call", "custom_vjp_call", "custom_vjp_call_jaxpr")


def jaxpr_digest(traced: ClosedJaxpr) -> str:
    """The sha256 of all operations of a traced function, with all their numbers.

    Arguments:
        traced: by `jax.make_jaxpr`.
    """
    whole = hashlib.sha256()
    for part in _parts(traced):
        whole.update(part)
        whole.update(b"\0")
    return whole.hexdigest()


def _parts(traced: ClosedJaxpr | Jaxpr) -> Iterator[bytes]:
    if isinstance(traced, ClosedJaxpr):
        yield from map(_number, traced.consts)
        traced = traced.jaxpr
    names: dict[Any, int] = {}

    def named(variable: Any) -> bytes:
        if isinstance(variable, Literal):
            return _number(variable.val)
        return f"{names.setdefault(variable, len(names))}:{variable.aval}".encode()

    yield from map(named, (*traced.constvars, *traced.invars))
    for equation in traced.eqns:
        yield equation.primitive.name.encode()
        yield from map(named, equation.invars)
        for name, value in sorted(equation.params.items()):
            yield name.encode()
            for each in value if isinstance(value, (tuple, list)) else (value,):
                if isinstance(each, (ClosedJaxpr, Jaxpr)):
                    yield from _parts(each)
                elif isinstance(each, (np.ndarray, jax.Array)):
                    yield _number(each)
                elif not (callable(each) and equation.primitive.name in _WITH_DERIVATIVES):
                    # Of other functions, such as callbacks, nothing is known but which they are.
                    yield repr(each).encode()
        yield from map(named, equation.outvars)
    yield from map(named, traced.outvars)


def _number(value: Any) -> bytes:
    if jax.numpy.issubdtype(getattr(value, "dtype", float), jax.dtypes.prng_key):
        value = jax.random.key_data(value)
    array = np.asarray(value)
    return f"{array.dtype}{array.shape}".encode() + array.tobytes()
