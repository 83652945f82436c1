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
# In a frame.
_MOST_ODE_STEPS = 1024
# Of Levenberg-Marquardt.
_MOST_STEPS = 40
# In place of what is not finite: so bad that the step is not taken.
_WORST = 1e6


@functools.partial(jax.jit, static_argnames=("rhs",))
def _sensitivities(
    rhs: Any, y0: Any, args: Any, ts: Any, units: Units, changes: Any, tolerance: Any
) -> tuple[Any, Any]:
    """The states behind the first sample, and their derivatives by the changes.

    Both are one system of equations (the variational equations beside the rope's own) with
    one error control. Each frame is solved for itself, so that steps end on the sample times:
    between them Dopri8 is of order 5 only. Nor does diffrax then have sample times to check as
    it runs, for which it would call back into Python; such a program could not be kept.
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
def fitted(
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
    """The changes with which a rope comes closest to states that are given.

    Arguments:
        rhs: of the rope.
        y0: its initial state.
        args: its numbers.
        ts: the sample times.
        units: of the changes.
        free: 1 where a change may be made and 0 elsewhere.
        start: changes to begin with.
        target: states behind the first sample, flat for each.
        weights: of the differences, of the same shape; 0 leaves one out.
        tolerance: of changes and weighted differences.

    Returns:
        The changes, the weighted differences that are left, flat, and their derivatives by
        the changes.
    """

    def measured(changes: Any) -> tuple[Any, Any]:
        states, slopes = _sensitivities(rhs, y0, args, ts, units, changes * free, tolerance)
        left = jnp.where(weights > 0, weights * (states - target), 0.0)
        left = jnp.where(jnp.isfinite(left), left, _WORST)
        slopes = jnp.where(jnp.isfinite(slopes), slopes, 0.0) * weights[..., None] * free
        return left.reshape(-1), slopes.reshape(-1, changes.shape[0])

    # The derivative comes with the states; nothing is differentiated twice.
    @jax.custom_jvp
    def residual(changes: Any, _: Any) -> tuple[Any, Any]:
        return measured(changes)

    @residual.defjvp
    def _(primals: Any, tangents: Any) -> Any:
        left, slopes = measured(primals[0])
        return (left, slopes), (slopes @ tangents[0], jnp.zeros_like(slopes))

    def with_slopes(changes: Any, none: Any) -> tuple[Any, Any]:
        left, slopes = residual(changes, none)
        return left, (left, slopes)

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
