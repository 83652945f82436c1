"""A problem with its numbers bound, as a stepper sees it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp

from ropeode.problems.problem import Mechanics
from ropeode.steppers.base import System
from ropeode.steppers.phase import Phase


def system(
    rhs: Callable,
    mechanics: Mechanics | None,
    args: Any,
    counted: Callable[[Callable], Callable] = lambda function: function,
) -> System:
    """A problem with its numbers bound, as a stepper sees it.

    Arguments:
        rhs: of the problem.
        mechanics: of the problem.
        args: of the problem.
        counted: wraps each function whose calls are to be counted.
    """
    if mechanics is None:
        return System(counted(lambda t, y: rhs(t, y, args)))
    damping, links, every_force = mechanics.damping, mechanics.links, mechanics.acceleration
    acceleration = counted(lambda t, x, v: every_force(t, x, v, args))
    return System(
        lambda t, y: Phase(y.v, acceleration(t, y.x, y.v)),
        acceleration,
        damping(args) if damping else None,
        links(args) if links else None,
    )


def stored(state: Any, always: Any) -> Any:
    """The state (or the positions) of a stage, computed once.

    XLA would fuse what computes it into each place of the right-hand side that reads it, and
    the stage before into that, and so on. `optimization_barrier` should keep it from that; but
    XLA for the processor drops it before it fuses, in JAX 0.10. It never looks into a choice.

    Arguments:
        state: an array, or a `Phase`.
        always: something true of which XLA does not know that it is.
    """
    if jax.default_backend() != "cpu":
        return jax.lax.optimization_barrier(state)
    return jax.lax.cond(
        always, lambda state: state, lambda state: jax.tree.map(jnp.zeros_like, state), state
    )
