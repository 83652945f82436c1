"""A problem with its numbers bound, as a stepper sees it."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable
from typing import Any, NamedTuple, NoReturn

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jax.tree_util import Partial

from ropeode.problems import Mechanics
from ropeode.problems.links import LinearDamping
from ropeode.simulation.jumps import Sides, own_side
from ropeode.simulation.user_clock import on_user_clock
from ropeode.steppers import Equations, Phase, Stepper, System
from ropeode.validation import bad_value


class InUnits(NamedTuple):
    """Arguments of a problem that is measured in other units.

    Fields:
        units: for its functions alone; step functions do not see them.
        args: of the problem in its own units.
    """

    units: Any
    args: Any


def system(
    rhs: Callable,
    mechanics: Mechanics | None,
    args: Any,
    *,
    counted: Callable[[Callable], Callable] = lambda function: function,
    turned: bool = False,
    in_numpy: bool = False,
) -> System:
    """A problem with its numbers bound, as a stepper sees it.

    Arguments:
        rhs, mechanics, args: of the problem.
        counted: wraps the function whose calls are to be counted, or seen from one side of a jump.
        turned: whether positions are stored ``(dim, nodes)`` and seen as ``(nodes, dim)``.
        in_numpy: whether the functions take and return NumPy arrays.
    """
    units = args.units if isinstance(args, InUnits) else None
    own = args.args if isinstance(args, InUnits) else args
    whole = functools.partial(_of_problem, units)

    if mechanics is None:
        slope = counted(_numpy_version(rhs) if in_numpy else rhs)

        # Python names these functions and their arguments to a step that calls them wrongly.
        def rhs_of_state(t: Any, y: Any, args: Any) -> Any:
            return slope(t, y, whole(args))

        rhs_of_state.in_jax = _in_jax(rhs, units)  # type: ignore[attr-defined]
        return System(Equations(rhs_of_state, _no_acceleration, own), mechanical=False)
    own_force = mechanics.acceleration
    force = counted(_numpy_version(own_force) if in_numpy else own_force)
    if turned:
        force = _turned(force)

    def acceleration(t: Any, x: Any, v: Any, args: Any) -> Any:
        return force(t, x, v, whole(args))

    def rhs_of_halves(t: Any, y: Any, args: Any) -> Any:
        a = force(t, y[0], y[1], whole(args))
        if isinstance(y, Phase):
            return Phase(y.v, a)
        # NumPy's own, where it will do: `jnp.stack` of NumPy arrays costs a hundred times as much.
        return (np if isinstance(a, np.ndarray) else jnp).stack([y[1], a])

    rhs_of_halves.in_jax = _in_jax(  # type: ignore[attr-defined]
        _first_order(own_force, turned), units
    )
    damping = mechanics.damping(args) if mechanics.damping else None
    return System(
        Equations(rhs_of_halves, acceleration, own),
        mechanical=True,
        damping=_turned_damping(damping) if turned and damping else damping,
        links=mechanics.links(args) if mechanics.links else None,
        neighbours=mechanics.neighbours,
    )


def is_turned(stepper: Stepper, mechanics: Mechanics | None) -> bool:
    """Whether a stepper sees positions ``(nodes, dim)`` that are stored ``(dim, nodes)``."""
    return not stepper.any_layout and mechanics is not None and mechanics.node_axis == 1


def as_seen(y: Any, mechanics: Mechanics | None, turned: bool) -> Any:
    """A state of a problem, ``(*state,)``, as a stepper sees it."""
    if mechanics is None:
        return y
    return Phase(y[0].T, y[1].T) if turned else Phase(y[0], y[1])


def as_stored(y: Any, mechanics: Mechanics | None, turned: bool) -> Any:
    """The opposite of `as_seen`; of NumPy arrays a NumPy array."""
    if mechanics is None:
        return y
    halves = [half.T if turned else half for half in y]
    return (np if all(isinstance(half, np.ndarray) for half in halves) else jnp).stack(halves)


def on_stored_states(
    stepper: Stepper, rhs: Callable, mechanics: Mechanics | None, sides: Sides = ()
) -> tuple[Callable, Callable, Callable]:
    """`init`, `step` and `state` of a stepper, in JAX: ``(args, t, y or what is carried, dt)``.

    `init` takes a state as the problem stores it, and `state` returns one. `sides` are those of
    the problem where steps end on its jumps.
    """
    turned = is_turned(stepper, mechanics)

    def bound(args: Any, inside: Any) -> System:
        seen = own_side(sides, inside)

        def from_here(function: Callable) -> Callable:
            return lambda t, *given: function(seen(t), *given)

        return system(rhs, mechanics, args, counted=from_here, turned=turned)

    def init(args: Any, t: Any, y: Any, dt: Any) -> Any:
        own = bound(args, t + dt / 2)
        return on_user_clock(stepper.init, own, t, as_seen(y, mechanics, turned), dt)

    def step(args: Any, t: Any, carried: Any, dt: Any) -> Any:
        return on_user_clock(stepper.step, bound(args, t + dt / 2), t, carried, dt)

    def state(args: Any, t: Any, carried: Any, dt: Any) -> Any:
        y = on_user_clock(stepper.state, bound(args, t - dt / 2), t, carried, dt)
        return as_stored(y, mechanics, turned)

    return init, step, state


def _no_acceleration(*_: Any) -> NoReturn:
    raise bad_value(
        "stepper",
        "one that asks for an acceleration",
        "steppers for any ODE, on a first-order problem",
        'write needs = "second order" into its class, or use system.rhs',
    )


def _turned(force: Callable) -> Callable:
    """An acceleration of positions ``(nodes, dim)``, where they are stored ``(dim, nodes)``."""
    return lambda t, x, v, args: force(t, x.T, v.T, args).T


def _in_jax(rhs: Callable, units: Any) -> Partial:
    """``rhs(t, y, own)`` in JAX, as an argument of programs: one serves for all units."""
    return Partial(_OfOwnArgs(rhs), units)


@dataclasses.dataclass(frozen=True)
class _OfOwnArgs:
    rhs: Callable

    def __call__(self, units: Any, t: Any, y: Any, own: Any) -> Any:
        return self.rhs(t, y, _of_problem(units, own))


def _of_problem(units: Any, own: Any) -> Any:
    """The arguments of a problem's functions, of those that steppers see."""
    return own if units is None else InUnits(units, own)


@functools.lru_cache(maxsize=64)
def _first_order(force: Callable, turned: bool) -> Callable:
    """The right-hand side in JAX, on stacked states."""
    force = _turned(force) if turned else force
    return lambda t, y, args: jnp.stack([y[1], force(t, y[0], y[1], args)])


def _turned_damping(damping: LinearDamping) -> LinearDamping:
    """Damping that broadcasts against positions ``(nodes, dim)``."""

    def turned(leaf: Any) -> Any:
        return leaf[:, None] if np.ndim(leaf) == 1 else jnp.transpose(leaf)

    return LinearDamping(*map(turned, damping))


@functools.lru_cache(maxsize=64)
def _numpy_version(function: Callable) -> Callable:
    """The same function, which takes NumPy arrays and returns one.

    Inside a loop of JAX's own it is traced, as such a loop wants it.
    """
    if (in_numpy := getattr(function, "in_numpy", None)) is not None:
        return in_numpy
    compiled = jax.jit(function)

    def plain(*given: Any) -> Any:
        value = compiled(*given)
        # A copy: what JAX hands out must not be written to.
        return value if isinstance(value, Tracer) else np.array(value)

    return plain


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


def positions_last(carried: Any, always: Any) -> Any:
    """What a step carries on, its positions computed after its velocities.

    XLA knows of no order between the two. Where it moves the positions first, as for explicit
    Euler, it has to copy the old ones for the forces, in each step. Here the positions wait for a
    choice that reads one of the velocities; no number changes.

    Arguments:
        carried: where it is no `Phase`, it is handed on as it is.
        always: something true of which XLA does not know that it is.
    """
    if not isinstance(carried, Phase) or jax.default_backend() != "cpu":
        return carried
    one = carried.v[(0,) * carried.v.ndim]
    done = jax.lax.cond(always, lambda one: True, lambda one: one > 0, one)
    return Phase(jnp.where(done, carried.x, jnp.zeros_like(carried.x)), carried.v)
