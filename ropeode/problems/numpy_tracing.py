"""Functions written in NumPy, traced by JAX.

NumPy hands its functions over to arguments that know better (`__array_ufunc__`, NEP 13, and
`__array_function__`, NEP 18). So what JAX traces goes through ``np.sin(y[0])`` in a wrapper that
answers with the function of the same name in `jax.numpy`. What NumPy does not hand over, such as
``math.sin`` or a Python `if`, raises, and so does what `jax.numpy` does not have.

Source: Hoyer et al., NEP 18, "A dispatch mechanism for NumPy's high level array functions" (2018).
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from typing import Any, NoReturn

import jax
import jax.numpy as jnp
import numpy as np


def with_numpy(function: Callable, *given: Any) -> Any:
    """``function(*given)`` for a function in NumPy, with arrays that JAX traces.

    Arguments:
        function: returns an array, a list or a number.
        given: pytrees of arrays.

    Raises:
        Exception: it computes what JAX cannot trace, or raises itself.
    """
    return _bare(function(*jax.tree.map(_Array, given)))


class _Array(np.lib.mixins.NDArrayOperatorsMixin):
    """An array of JAX where NumPy expects one of its own; it can be written to."""

    def __init__(self, value: Any):
        self.value = jnp.asarray(value)

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **more: Any) -> Any:
        out = more.pop("out", None)
        if method != "__call__" or more:
            return NotImplemented
        value = getattr(jnp, ufunc.__name__)(*map(_bare, inputs))
        if out is None:
            return _dressed(value)
        # An assignment such as y += x.
        (own,) = out
        own.value = jnp.broadcast_to(value, own.shape)
        return own

    def __array_function__(self, function: Any, types: Any, args: Any, named: Any) -> Any:
        # As in numpy.linalg.norm.
        where = [*function.__module__.split(".")[1:], function.__name__]
        same: Any = functools.reduce(getattr, where, jnp)
        options = {key: _bare(each) for key, each in named.items()}
        return _dressed(same(*map(_bare, args), **options))

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            # NumPy asks for ways to the numbers, and there are none.
            raise AttributeError(name)
        if not hasattr(self.value, name):
            # A function of an array of objects is a method of each to NumPy.
            return lambda: _dressed(getattr(jnp, name)(self.value))
        found = getattr(self.value, name)
        if not callable(found):
            return _dressed(found)
        return lambda *given, **named: _dressed(found(*map(_bare, given), **named))

    def __getitem__(self, key: Any) -> _Array:
        return _Array(self.value[key])

    def __setitem__(self, key: Any, value: Any) -> None:
        self.value = self.value.at[key].set(_bare(value))

    def __len__(self) -> int:
        return len(self.value)

    def __iter__(self) -> Iterator[_Array]:
        return map(_Array, self.value)

    def __bool__(self) -> NoReturn:
        raise TypeError("its value is not known while JAX traces")


def _bare(value: Any) -> Any:
    """What `jax.numpy` takes: arrays and numbers, in lists and tuples."""
    if isinstance(value, _Array):
        return value.value
    if isinstance(value, np.ndarray) and value.dtype == object:
        # `np.array` of some of these.
        return jnp.stack([jnp.asarray(_bare(each)) for each in value])
    if isinstance(value, (list, tuple)):
        if isinstance(value, list) and not any(isinstance(leaf, _Array) for leaf in _leaves(value)):
            return np.asarray(value)
        return type(value)(map(_bare, value))
    return value


def _leaves(value: Any) -> list[Any]:
    return jax.tree.leaves(value, is_leaf=lambda each: isinstance(each, _Array))


def _dressed(value: Any) -> Any:
    if isinstance(value, (list, tuple)):
        return type(value)(map(_dressed, value))
    return _Array(value) if isinstance(value, jax.Array) else value
