"""The rope in JAX without ropeode: a naive `lax.scan`, and diffrax with constant steps.

What a user writes who has positions as ``(nodes, 2)`` and the formula for a spring.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

import diffrax
import jax
import jax.numpy as jnp

from ropeode.problems.rope import RopeArgs


def acceleration(x: Any, v: Any, args: RopeArgs) -> Any:
    """Of each node, ``(nodes, 2)``; forces are added up spring by spring."""
    apart = x[1:] - x[:-1]
    length = jnp.linalg.norm(apart, axis=1)
    pull = (args.stiffness * (length - args.rest_length) / length)[:, None] * apart
    force = jnp.zeros_like(x).at[:-1].add(pull).at[1:].add(-pull)
    force = force - args.damping[:, None] * v
    return (force / args.mass[:, None] + args.gravity.T) * args.free[:, None]


def explicit_euler(x: Any, v: Any, dt: Any, args: RopeArgs) -> Any:
    return x + dt * v, v + dt * acceleration(x, v, args)


def semi_implicit_euler(x: Any, v: Any, dt: Any, args: RopeArgs) -> Any:
    v = v + dt * acceleration(x, v, args)
    return x + dt * v, v


def verlet(x: Any, before: Any, dt: Any, args: RopeArgs) -> Any:
    a = acceleration(x, jnp.zeros_like(x), args)
    return x + ((1 - args.damping[:, None]) * (x - before) + dt**2 * a), x


STEPS: dict[str, Callable] = {
    "explicit-euler": explicit_euler,
    "semi-implicit-euler": semi_implicit_euler,
    "verlet": verlet,
}


@functools.partial(jax.jit, static_argnames=("step", "steps"))
def scan(step: Callable, x: Any, second: Any, dt: Any, args: RopeArgs, steps: int) -> Any:
    """Positions after so many steps, ``(nodes, 2)``."""

    def body(carried: Any, _: None) -> tuple[Any, None]:
        return step(*carried, dt, args), None

    return jax.lax.scan(body, (x, second), None, length=steps)[0][0]


@functools.partial(jax.jit, static_argnames=("step", "steps"))
def scan_many(step: Callable, x: Any, second: Any, dt: Any, args: RopeArgs, steps: int) -> Any:
    """The same for many ropes, with `vmap`; all but `dt` have the rope as their first axis."""
    return jax.vmap(lambda x, second, args: scan(step, x, second, dt, args, steps))(x, second, args)


def _slope(t: Any, y: Any, args: RopeArgs) -> Any:
    x, v = y
    return v, acceleration(x, v, args)


def _kick(t: Any, x: Any, args: RopeArgs) -> Any:
    return acceleration(x, jnp.zeros_like(x), args)


def _drift(t: Any, v: Any, args: RopeArgs) -> Any:
    return v


@functools.partial(jax.jit, static_argnames=("solver",))
def by_diffrax(solver: Any, x: Any, v: Any, dt: Any, args: RopeArgs, ts: Any) -> Any:
    """Positions at the times `ts`, which are ends of steps, ``(times, nodes, 2)``.

    `SemiImplicitEuler` takes the velocities first, so that it does what ropeode's does; its
    forces cannot depend on velocities.
    """
    split = isinstance(solver, diffrax.SemiImplicitEuler)
    ode = diffrax.ODETerm
    solved = diffrax.diffeqsolve(
        (ode(_kick), ode(_drift)) if split else ode(_slope),
        solver,
        ts[0],
        ts[-1],
        dt,
        (v, x) if split else (x, v),
        args,
        saveat=diffrax.SaveAt(ts=ts),
        # Not a number: that would count steps which a forward solve need not keep.
        max_steps=None,
        adjoint=diffrax.ForwardMode(),
    )
    return solved.ys[1 if split else 0]


@functools.partial(jax.jit, static_argnames=("solver",))
def many_by_diffrax(solver: Any, x: Any, v: Any, dt: Any, args: RopeArgs, ts: Any) -> Any:
    """The same for many ropes, with `vmap`; `x`, `v` and `args` have them as first axis."""
    solve = functools.partial(by_diffrax, solver)
    return jax.vmap(lambda x, v, args: solve(x, v, dt, args, ts))(x, v, args)
