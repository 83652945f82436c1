"""Why constraint Verlet is of order 1: it pulls along the links as they are a step later."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from scipy.integrate import solve_ivp

from ropeode.norms import NORMS, distance
from ropeode.precision import in_float64
from ropeode.problems import Problem
from ropeode.problems.rope import rigid_links

_RTOL = 1e-10


@in_float64
def predicted_by_lag(problem: Problem) -> float:
    """The error over dt, as dt goes to 0, of an inextensible rope whose tensions turn late.

    The tensions that keep the lengths at time t act along the links at ``t + dt``, to first order
    ``x + dt v``, and after the damping of the step. The derivative of the solution by that dt is
    the coefficient of the error; it solves the variational equation ``e' = f_y e + f_dt``.

    Arguments:
        problem: of an `InextensibleRope`.

    Returns:
        The largest distance of a node over the samples, in length units per unit of time.
    """
    args = problem.args

    def both(t: float, rows: np.ndarray) -> np.ndarray:
        y, e = rows.reshape(2, *problem.y0.shape)
        slope, change = variation(jnp.asarray(y), jnp.asarray(e))
        return np.concatenate([np.ravel(slope), np.ravel(change)])

    @jax.jit
    def variation(y: Any, e: Any) -> tuple[Any, Any]:
        def rate(y: Any, late: Any) -> Any:
            return jnp.stack([y[1], late_acceleration(y[0], y[1], late, args)])

        return jax.jvp(rate, (y, 0.0), (e, 1.0))

    start = np.concatenate([problem.y0.ravel(), np.zeros(problem.y0.size)])
    span = (problem.ts[0], problem.ts[-1])
    found = solve_ivp(both, span, start, "DOP853", problem.ts, rtol=_RTOL, atol=_RTOL)
    states = found.y.T.reshape(-1, 2, *problem.y0.shape)[:, 1]
    return float(np.max(distance(problem, NORMS["position-max"], states, np.zeros_like(states))))


def late_acceleration(x: Any, v: Any, late: Any, args: Any) -> Any:
    """The acceleration of a rope whose tensions act along the links of ``x + late v``.

    Arguments:
        x: positions, ``(dim, nodes)``.
        v: velocities, ``(dim, nodes)``.
        late: by how much time, in the problem's unit.
        args: the rope's numbers.
    """
    own = rigid_links(args)
    free = own.acceleration - own.damping.rate * v
    d, w, turned = (jnp.diff(each, axis=1) for each in (x, v, x + late * v))

    def pull(tension: Any) -> Any:
        """What tensions along the late links accelerate the nodes by."""
        force = jnp.pad(tension * turned, ((0, 0), (1, 1)))
        # The sweep comes after the damping, which divides the rest by 1 + dt/2 rate.
        return own.inverse_mass * (1.0 + own.damping.rate * late / 2.0) * jnp.diff(force, axis=1)

    def stretch(a: Any) -> Any:
        return jnp.sum(d * jnp.diff(a, axis=1), axis=0)

    # Linear in the tensions: they are such that no link's length is changing, at any time.
    matrix = jax.vmap(lambda unit: stretch(pull(unit)))(jnp.eye(d.shape[1])).T
    tension = jnp.linalg.solve(matrix, -stretch(free) - jnp.sum(w * w, axis=0))
    return free + pull(tension)
