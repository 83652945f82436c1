"""Positions and velocities as one vector, without being stored as one array."""

from __future__ import annotations

import dataclasses
import operator
from collections.abc import Callable, Iterator
from typing import Any, NoReturn

import jax
import numpy as np


def _componentwise(operation: Callable[[Any, Any], Any]) -> tuple[Callable, Callable]:
    """An operator and its reflection, applied to positions and velocities apart."""

    def forward(self: Phase, other: Any) -> Any:
        if isinstance(other, Phase):
            return Phase(operation(self.x, other.x), operation(self.v, other.v))
        if np.ndim(other) == 0:
            return Phase(operation(self.x, other), operation(self.v, other))
        return NotImplemented

    def reflected(self: Phase, other: Any) -> Any:
        if np.ndim(other) == 0:
            return Phase(operation(other, self.x), operation(other, self.v))
        return NotImplemented

    return forward, reflected


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True, eq=False)
class Phase:
    """A point ``(x, v)`` of phase space: a vector with the arithmetic of an array.

    It adds, subtracts, and is multiplied and divided by numbers, so that a stepper written for
    any ODE (``y + dt * k``) runs on it unchanged. ``y[0]`` and ``y.x`` are the positions, ``y[1]``
    and ``y.v`` the velocities. XLA keeps the two arrays apart: stacking them inside the step costs
    two to four times the run time.

    Arguments:
        x: positions, ``(nodes, dim)``.
        v: velocities, of the same shape.

    Examples:
        >>> import numpy as np
        >>> from ropeode import Phase
        >>> y = Phase(np.array([[0.0, 1.0]]), np.array([[2.0, 0.0]]))
        >>> y + 0.5 * Phase(y.v, np.array([[0.0, -9.81]]))
        Phase(x=array([[1., 1.]]), v=array([[ 2.   , -4.905]]))
    """

    x: Any
    v: Any

    # NumPy's numbers then leave the product ``number * phase`` to `__rmul__`.
    __array_ufunc__ = None

    __add__, __radd__ = _componentwise(operator.add)
    __sub__, __rsub__ = _componentwise(operator.sub)
    __mul__, __rmul__ = _componentwise(operator.mul)
    __truediv__, __rtruediv__ = _componentwise(operator.truediv)
    __pow__, __rpow__ = _componentwise(operator.pow)

    def __neg__(self) -> Phase:
        return Phase(-self.x, -self.v)

    def __pos__(self) -> Phase:
        return self

    def __iter__(self) -> Iterator[Any]:
        yield self.x
        yield self.v

    def __len__(self) -> int:
        return 2

    def __getitem__(self, index: int) -> Any:
        if not isinstance(index, int):
            raise TypeError(f"a Phase has y[0] (or y.x) and y[1] (or y.v), and no y[{index!r}]")
        return (self.x, self.v)[index]

    @property
    def shape(self) -> tuple[int, ...]:
        """Of positions and velocities stacked, ``(2, nodes, dim)``."""
        return (2, *np.shape(self.x))

    def _undefined(self, *_: Any) -> NoReturn:
        raise TypeError("a Phase is not compared as a whole; compare its .x and its .v")

    __eq__ = __ne__ = __lt__ = __le__ = __gt__ = __ge__ = __bool__ = _undefined  # type: ignore[assignment]
    __hash__ = None  # type: ignore[assignment]
