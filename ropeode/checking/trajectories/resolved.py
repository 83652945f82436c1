"""Over how much of a motion runs are fine enough to show that they do not converge to it."""

from __future__ import annotations

import dataclasses
import functools

import jax
import jax.numpy as jnp
import numpy as np

from ropeode.precision import in_float64
from ropeode.references import Reference

# The error of a method of order 1, after a time T, is a part of about `rate^2 T dt / 2` of what
# moves fastest: it has another phase or amplitude. Beyond so many times that, errors need not fall.
_MOST = 16.0
# States of the reference at which the rate is taken, and products with the Jacobian there.
_STATES, _PRODUCTS = 16, 64


def resolved_frames(reference: Reference, dt: float, rate: float) -> int:
    """The frames from the start over which errors of a step size have to fall with it.

    Arguments:
        reference: of the problem.
        dt: a step size.
        rate: the `fastest_rate` of the problem.
    """
    times = reference.problem.ts[: reference.trusted] - reference.problem.ts[0]
    return int(np.sum(times[1:] * dt * rate**2 <= _MOST))


def resolving_step(reference: Reference, rate: float) -> float:
    """The largest step size with which one frame at least is resolved."""
    first, second = reference.problem.ts[:2]
    return _MOST / (rate**2 * float(second - first))


def beginning(reference: Reference, frames: int) -> Reference | None:
    """The reference, trusted over so many frames at most; None without a frame."""
    if frames == 0:
        return None
    trusted = min(reference.trusted, frames + 1)
    certificate = dataclasses.replace(reference.certificate, trusted=trusted)
    return dataclasses.replace(reference, certificate=certificate)


@functools.lru_cache(maxsize=4)
@in_float64
def fastest_rate(reference: Reference) -> float:
    """How fast the fastest part of a motion changes: the largest eigenvalue of its Jacobian.

    By powers of the Jacobian at states of the reference; the geometric mean of their growth is
    a few percent off.
    """
    problem = reference.problem
    states = reference.states[: reference.trusted]
    chosen = np.unique(np.linspace(0, len(states) - 1, _STATES).astype(int))
    start = np.random.default_rng(0).normal(size=problem.y0.shape)

    def growth(t: jax.Array, y: jax.Array) -> jax.Array:
        def product(carry: tuple[jax.Array, jax.Array], _: None):
            direction, total = carry
            ahead = jax.jvp(lambda y: problem.rhs(t, y, problem.args), (y,), (direction,))[1]
            size = jnp.sqrt(jnp.sum(ahead**2))
            return (ahead / jnp.maximum(size, 1e-300), total + jnp.log(size)), None

        (_, total), _ = jax.lax.scan(product, (start, jnp.zeros(())), None, length=_PRODUCTS)
        return jnp.exp(total / _PRODUCTS)

    each = jax.jit(jax.vmap(growth))(problem.ts[chosen], states[chosen])
    return float(np.nanmax(each))
