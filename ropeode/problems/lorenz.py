"""The Lorenz system: convection in three numbers, and the best known chaos."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from ropeode.problems.parameters import library_problem
from ropeode.problems.picture import plane
from ropeode.problems.problem import Problem
from ropeode.validation import Finite, FiniteTriple, Positive, WholePositive


class LorenzArgs(NamedTuple):
    """The numbers in the equations."""

    sigma: Any
    rho: Any
    beta: Any


@library_problem(plane(0, 2, ("x", "z")))
def lorenz(
    frames: WholePositive = 20,
    duration: Positive = 10.0,
    sigma: Finite = 10.0,
    rho: Finite = 28.0,
    beta: Finite = 8.0 / 3.0,
    y0: FiniteTriple = (1.0, 1.0, 1.0),
) -> Problem:
    """``x' = sigma (y - x)``, ``y' = x (rho - z) - y``, ``z' = x y - beta z``.

    The state has the shape (3,).

    Arguments:
        frames: number of equal intervals between sample times.
        duration: time that they cover together.
        sigma: Prandtl number.
        rho: Rayleigh number over its critical value.
        beta: from the shape of the convection cells.
        y0: x, y and z at the start.

    Raises:
        InputError: one line for each argument that cannot be used.

    Source: Lorenz, Deterministic nonperiodic flow, Journal of the Atmospheric Sciences 20
    (1963), equations (25) to (27).
    """
    return Problem(
        rhs,
        np.array(y0),
        np.linspace(0.0, duration, frames + 1),
        LorenzArgs(sigma, rho, beta),
        name="Lorenz",
    )


def rhs(t: Any, y: Any, args: LorenzArgs) -> Any:
    """The derivative of `y`; `t` is not used."""
    del t
    x, y, z = y
    return jnp.stack([args.sigma * (y - x), x * (args.rho - z) - y, x * y - args.beta * z])
