"""The fit as a program that JAX compiles once for all ropes of a family."""

# Equinox modules declare fields that a wrapper gives as properties; pyright cannot see that.
# pyright: reportAssignmentType=false, reportCallIssue=false
from __future__ import annotations

import functools
from typing import Any

import diffrax
import jax
import jax.numpy as jnp
import optimistix

from ropeode.checking.diagnosis.parameters import Units, changed

# Of the ODE solver, as far as float64 goes.
_FINEST, _COARSEST = 1e-11, 1e-6
# Per frame.
_MOST_ODE_STEPS = 1024
# Of Levenberg-Marquardt.
_MOST_STEPS = 40
# Replaces a residual that is not finite: so large that the solver rejects the step.
_WORST = 1e6


@functools.partial(jax.jit, static_argnames=("rhs",))
def _sensitivities(
    rhs: Any, y0: Any, args: Any, ts: Any, units: Units, changes: Any, tolerance: Any
) -> tuple[Any, Any]:
    """The states after the first sample, and their derivatives by the changes.

    Both are one system (the rope's equations with their variational equations) under one error
    control. Each frame is a solve of its own, so that steps end on the sample times: between
    steps Dopri8 is of order 5 only. This also avoids diffrax's run-time check of sample times,
    a callback to Python that would keep the program out of the compilation cache.
    """
    shape, directions = y0.shape, jnp.eye(changes.shape[0])
    rtol = jnp.clip(tolerance, _FINEST, _COARSEST)

    def start(changes: Any) -> Any:
        return changed(y0, args, units, changes)[0].reshape(-1)

    def own(t: Any, y: Any, changes: Any) -> Any:
        return rhs(t, y.reshape(shape), changed(y0, args, units, changes)[1]).reshape(-1)

    def field(t: Any, both: Any, changes: Any) -> Any:
        slope, push = jax.linearize(functools.partial(own, t), both[0], changes)
        return jnp.concatenate([slope[None], jax.vmap(push)(both[1:], directions)])

    def frame(both: Any, times: Any) -> tuple[Any, Any]:
        solution = diffrax.diffeqsolve(
            diffrax.ODETerm(field),
            diffrax.Dopri8(),
            times[0],
            times[1],
            None,
            both,
            changes,
            saveat=diffrax.SaveAt(t1=True),
            stepsize_controller=diffrax.PIDController(rtol=rtol, atol=rtol * units.scale),
            max_steps=_MOST_ODE_STEPS,
            adjoint=diffrax.ForwardMode(),
            throw=False,
        )
        assert solution.ys is not None
        return solution.ys[0], solution.ys[0]

    first, push = jax.linearize(start, changes)
    both = jnp.concatenate([first[None], jax.vmap(push)(directions)])
    _, states = jax.lax.scan(frame, both, jnp.stack([ts[:-1], ts[1:]], axis=1))
    return states[:, 0], jnp.moveaxis(states[:, 1:], 1, -1)


@functools.partial(jax.jit, static_argnames=("rhs",))
def solve_fit(
    rhs: Any,
    y0: Any,
    args: Any,
    ts: Any,
    units: Units,
    free: Any,
    start: Any,
    target: Any,
    weights: Any,
    tolerance: Any,
) -> tuple[Any, Any, Any]:
    """The changes with which a rope comes closest to target states.

    Arguments:
        rhs: of the rope.
        y0: its initial state.
        args: its numbers.
        ts: the sample times.
        units: of the changes.
        free: 1 for each parameter that may change and 0 for the others.
        start: changes to begin with.
        target: states after the first sample, each one flat.
        weights: of the differences, of the same shape; 0 leaves one out.
        tolerance: of changes and weighted differences.

    Returns:
        The changes, the weighted residual, flat, and its derivatives by the changes.
    """

    def measured(changes: Any) -> tuple[Any, Any]:
        states, slopes = _sensitivities(rhs, y0, args, ts, units, changes * free, tolerance)
        residual = jnp.where(weights > 0, weights * (states - target), 0.0)
        residual = jnp.where(jnp.isfinite(residual), residual, _WORST)
        slopes = jnp.where(jnp.isfinite(slopes), slopes, 0.0) * weights[..., None] * free
        return residual.reshape(-1), slopes.reshape(-1, changes.shape[0])

    # The derivative comes with the states; nothing is differentiated twice.
    @jax.custom_jvp
    def difference(changes: Any, _: Any) -> tuple[Any, Any]:
        return measured(changes)

    @difference.defjvp
    def _(primals: Any, tangents: Any) -> Any:
        residual, slopes = measured(primals[0])
        return (residual, slopes), (slopes @ tangents[0], jnp.zeros_like(slopes))

    def with_slopes(changes: Any, none: Any) -> tuple[Any, Any]:
        residual, slopes = difference(changes, none)
        return residual, (residual, slopes)

    solution = optimistix.least_squares(
        with_slopes,
        optimistix.LevenbergMarquardt(rtol=tolerance, atol=tolerance),
        start,
        None,
        has_aux=True,
        max_steps=_MOST_STEPS,
        throw=False,
    )
    return solution.value * free, *solution.aux
