"""A rope's motion and its derivatives by the rope's parameters, as one compiled program."""

# Equinox modules declare fields that a wrapper gives as properties; pyright cannot see that.
# pyright: reportAssignmentType=false, reportCallIssue=false
from __future__ import annotations

import functools
from typing import Any

import diffrax
import jax
import jax.numpy as jnp

from ropeode.checking.diagnosis.parameters import Units, changed

# Of the ODE solver, as far as float64 goes.
_FINEST, _COARSEST = 1e-11, 1e-6
# Per frame.
_MOST_STEPS = 1024


@functools.partial(jax.jit, static_argnames=("rhs",))
def sensitivities(
    rhs: Any, y0: Any, args: Any, ts: Any, units: Units, changes: Any, tolerance: Any
) -> tuple[Any, Any]:
    """The states of a rope with changed parameters, and their derivatives by the changes.

    Both are one system (the rope's equations with their variational equations) under one error
    control. Each frame is a solve of its own, so that steps end on the sample times: between
    steps Dopri8 is of order 5 only. This also avoids diffrax's run-time check of sample times,
    a callback to Python that would keep the program out of the compilation cache.

    Arguments:
        rhs: of the rope.
        y0: its initial state.
        args: its numbers.
        ts: the sample times, ``(times,)``.
        units: of the changes.
        changes: of all parameters, ordered as `parameters.places` says.
        tolerance: relative, of the ODE solver.

    Returns:
        The states after the first sample, each one flat, ``(times - 1, numbers)``, and their
        derivatives, ``(times - 1, numbers, changes)``.
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
            max_steps=_MOST_STEPS,
            adjoint=diffrax.ForwardMode(),
            throw=False,
        )
        assert solution.ys is not None
        return solution.ys[0], solution.ys[0]

    first, push = jax.linearize(start, changes)
    both = jnp.concatenate([first[None], jax.vmap(push)(directions)])
    _, states = jax.lax.scan(frame, both, jnp.stack([ts[:-1], ts[1:]], axis=1))
    return states[:, 0], jnp.moveaxis(states[:, 1:], 1, -1)
