"""Newton's method for the equations of implicit steps."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import Any, Literal, NamedTuple

import jax
import jax.numpy as jnp

from ropeode.steppers.base import System
from ropeode.steppers.block_tridiagonal import solve_neighbours, solve_small
from ropeode.steppers.phase import Phase
from ropeode.steppers.reductions import largest

# How Newton's method ends: when it has converged, or after one iteration.
Iterations = Literal["converged", "1"]

# Newton's method squares its error: what a correction so small beside the state leaves is below
# the state's rounding. It is far above the rounding of the equations, which no iteration removes.
_CLOSE = 1e-10
# A correction that is small only since the step is short says nothing; the one after it does.
_FEWEST_ITERATIONS, _MOST_ITERATIONS = 2, 30
# Squares of larger numbers overflow: a run that comes so far has diverged.
_HUGE = 1e150
# Dense systems of so many unknowns are solved without a call of LAPACK.
_SMALL = 6


class Newton(NamedTuple):
    """What became of Newton's method since the start of a run.

    Fields:
        solved: whether it has converged in each step, ``(ropes,)``.
        iterations: how many it has made, ``(ropes,)``.
    """

    solved: Any
    iterations: Any


class Stages(NamedTuple):
    """The equations ``Z_i = shift + sum_j weights[i][j] f(times[j], y + Z_j)`` of a step.

    Fields:
        times: of the stages.
        weights: a row for each stage; they contain the step size.
        shift: like the state; None for zero.
    """

    times: Sequence[Any]
    weights: Sequence[Sequence[Any]]
    shift: Any = None


class _Linear(NamedTuple):
    """The equations, linearised: ``linear(u) = right``, and the corrections that follow."""

    right: Any
    linear: Callable[[Any], Any]
    corrections: Callable[[Any], tuple]


def ropes(system: System) -> int:
    """How many ropes stand side by side: systems of equations that are apart from each other."""
    return 1 if system.links is None else system.links.apart


def unstarted(system: System) -> Newton:
    """At the start of a run."""
    count = ropes(system)
    return Newton(jnp.ones(count, bool), jnp.zeros(count, jnp.int64))


def solve(
    system: System, stages: Stages, y: Any, newton: Newton, iterations: Iterations
) -> tuple[list[Any], Newton]:
    """The increments ``Z_i`` of a step's stages, by Newton's method from ``Z_i = 0``.

    Of ropes side by side each makes as many iterations as it makes alone, so that its result does
    not depend on the others. Where Newton's method does not converge, or the run has
    diverged, the increments are not-a-number.

    Arguments:
        system: the problem.
        stages: what to solve.
        y: the state at the start of the step.
        newton: what became of it so far.
        iterations: `converged`, or `1` for a single one and no test: the equations linearised at
            the old state.

    Source: Hairer, Wanner, Solving ODEs II, section IV.8.
    """
    count, mechanical = ropes(system), system.mechanical
    linearised = _of_second_order if mechanical else _of_first_order
    old = tuple(y) if mechanical else (y,)
    zero = tuple(jnp.zeros((len(stages.times), *jnp.shape(each))) for each in old)

    def size(parts: Any) -> Any:
        return largest(jnp.abs(parts.reshape(-1, count)))

    def where(of_ropes: Any, some: Any, other: Any) -> Any:
        return jnp.where(jnp.tile(of_ropes, some.size // count).reshape(some.shape), some, other)

    def corrected(z: tuple) -> tuple[tuple, Any]:
        """The next increments, and whether the corrections were small."""
        right, linear, corrections = linearised(system, stages, y, z)
        u = _solved(system, linear, right)
        # An infinite derivative makes a correction zero, which looks converged. 0 * inf tells.
        changes = corrections(u + 0.0 * linear(u))
        new = tuple(each + change for each, change in zip(z, changes, strict=True))
        # Positions, or velocities: near a zero of one of them, the other still has its size. A new
        # state that is tiny has roundings of the old one.
        small = [
            size(change) <= _CLOSE * (size(of_y) + size(each + of_y))
            for change, each, of_y in zip(changes, new, old, strict=True)
        ]
        return new, sum(small) > 0

    def iterate(loop: tuple) -> tuple:
        made, z, _, active = loop
        new, close = corrected(z)
        # A rope alone is in the loop only as long as it goes on.
        z = new if count == 1 else tuple(map(lambda a, b: where(active, a, b), new, z))
        made = made + active
        finite = jnp.isfinite(sum(map(size, z)))
        done = close & finite & (made >= _FEWEST_ITERATIONS)
        return made, z, done, active & ~done & finite & (made < _MOST_ITERATIONS)

    started = sum(map(size, old)) < _HUGE
    if iterations == "1":
        z, _ = corrected(zero)
        newton = newton._replace(iterations=newton.iterations + started)
    else:
        nothing = jnp.zeros(count, jnp.int64), zero, jnp.zeros(count, bool), started
        made, z, done, _ = jax.lax.while_loop(lambda loop: jnp.any(loop[-1]), iterate, nothing)
        z = tuple(where(done, each, jnp.nan) for each in z)
        newton = Newton(newton.solved & (done | ~started), newton.iterations + made)
    each_stage = zip(*z, strict=True)
    return [Phase(*one) if mechanical else one[0] for one in each_stage], newton


def _of_first_order(system: System, stages: Stages, y: Any, z: tuple) -> _Linear:
    """The equations of any ODE, linearised at the increments `z`."""
    times, weights, shift = stages
    f, of_f = _linearised(system.rhs, times, [(y + each,) for each in z[0]])
    right = _combined(weights, f) - z[0]

    def linear(u: Any) -> Any:
        return u - _combined(weights, [of(each) for of, each in zip(of_f, u, strict=True)])

    return _Linear(right if shift is None else right + shift, linear, lambda u: (u,))


def _of_second_order(system: System, stages: Stages, y: Phase, z: tuple) -> _Linear:
    """Those of ``x' = v, v' = a(t, x, v)``; the unknowns are the velocities' corrections alone.

    The positions' equations are linear: what corrects the velocities by u corrects the positions
    by ``weights u``, and by what was missing in their equations.
    """
    times, weights, shift = stages
    zx, zv = z
    at = [(y.x + x, y.v + v) for x, v in zip(zx, zv, strict=True)]
    a, of_a = _linearised(system.acceleration, times, at)
    missing = _combined(weights, [v for _, v in at]) - zx
    if shift is not None:
        missing = missing + shift.x
    still = jnp.zeros_like(y.v)
    slopes = [a + of(x, still) for a, of, x in zip(a, of_a, missing, strict=True)]
    right = _combined(weights, slopes) - zv

    def linear(u: Any) -> Any:
        moved = _combined(weights, u)
        return u - _combined(weights, [of(x, v) for of, x, v in zip(of_a, moved, u, strict=True)])

    return _Linear(
        right if shift is None else right + shift.v,
        linear,
        lambda u: (missing + _combined(weights, u), u),
    )


def _linearised(
    function: Callable, times: Sequence[Any], at: Sequence[tuple]
) -> tuple[list[Any], list[Callable]]:
    """``function(time, ...)`` at each stage, and its derivatives there."""
    pairs = [
        jax.linearize(functools.partial(function, t), *each)
        for t, each in zip(times, at, strict=True)
    ]
    return [value for value, _ in pairs], [derivative for _, derivative in pairs]


def _combined(weights: Sequence[Sequence[Any]], values: Any) -> Any:
    """``sum_j weights[i][j] values[j]``, stacked."""
    return jnp.stack(
        [sum(w * value for w, value in zip(row, values, strict=True)) for row in weights]
    )


def _solved(system: System, linear: Callable[[Any], Any], right: Any) -> Any:
    """The solution of ``linear(u) = right``, with ``(stages, *state)`` unknowns."""
    count = ropes(system)
    if system.neighbours and system.links is not None:
        nodes = system.links.inverse_mass.shape[-1] // count
        shape: tuple[int, ...] = (-1, nodes, count)
        found = solve_neighbours(
            lambda u: linear(u.reshape(right.shape)).reshape(shape), right.reshape(shape)
        )
        return found.reshape(right.shape)
    flat = right.reshape(-1, count)
    unknowns = len(flat)
    seeds = jnp.where(jnp.arange(unknowns)[:, None] == jnp.arange(unknowns), 1.0, 0.0)
    seeds = jnp.broadcast_to(seeds[..., None], (unknowns, *flat.shape))
    columns = jax.vmap(linear)(seeds.reshape(unknowns, *right.shape)).reshape(seeds.shape)
    matrix = columns.swapaxes(0, 1)
    if unknowns <= _SMALL:
        return solve_small(matrix, flat[:, None])[:, 0].reshape(right.shape)
    found = jnp.linalg.solve(jnp.moveaxis(matrix, 2, 0), flat.T[..., None])
    return found[..., 0].T.reshape(right.shape)
