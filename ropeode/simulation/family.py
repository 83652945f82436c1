"""Which runs share one compiled program."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import numpy as np

from ropeode.problems import Mechanics
from ropeode.simulation.layout import Layout
from ropeode.simulation.method import Method


class Family(NamedTuple):
    """What runs have in common that one program can make; hashable.

    Fields:
        method: the stepper, ready to run.
        rhs, mechanics: of the problem.
        layout: of the runs in a block.
        y0: the initial state of a block.
        args_tree, args_leaves: the problem's arguments, for a block.
    """

    method: Method
    rhs: Callable
    mechanics: Mechanics | None
    layout: Layout
    y0: jax.ShapeDtypeStruct
    args_tree: Any
    args_leaves: tuple[jax.ShapeDtypeStruct, ...]


def shape_of(shape: tuple[int, ...], dtype: Any = np.float64) -> jax.ShapeDtypeStruct:
    """What stands for an array while nothing is computed."""
    return jax.ShapeDtypeStruct(shape, dtype)
