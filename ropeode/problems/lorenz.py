"""The Lorenz system: convection in three numbers, and the best known chaos."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from ropeode.problems.problem import Problem
from ropeode.validation import Finite, FiniteTriple, Input, Positive, WholePositive, field


class LorenzArgs(NamedTuple):
    """The numbers in the equations."""

    sigma: Any
    rho: Any
    beta: Any


class _Arguments(Input):
    """The arguments of `lorenz`, checked."""

    frames: WholePositive = field(..., allowed="a whole number >= 1", example="20")
    duration: Positive = field(..., allowed="a finite number > 0", example="10.0")
    sigma: Finite = field(..., allowed="a finite number", example="10.0")
    rho: Finite = field(..., allowed="a finite number", example="28.0")
    beta: Finite = field(..., allowed="a finite number", example="2.6666666666666665")
    y0: FiniteTriple = field(..., allowed="three finite numbers", example="[1.0, 1.0, 1.0]")


def lorenz(
    frames: int = 20,
    duration: float = 10.0,
    sigma: float = 10.0,
    rho: float = 28.0,
    beta: float = 8.0 / 3.0,
    y0: Sequence[float] = (1.0, 1.0, 1.0),
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
    checked = _Arguments(
        frames=frames,
        duration=duration,
        sigma=sigma,
        rho=rho,
        beta=beta,
        y0=y0,  # pyright: ignore[reportArgumentType]
    )
    return Problem(
        rhs,
        np.array(checked.y0),
        np.linspace(0.0, checked.duration, checked.frames + 1),
        LorenzArgs(checked.sigma, checked.rho, checked.beta),
        name="Lorenz",
        parameters={"kind": "lorenz", **checked.model_dump(mode="json")},
    )


def rhs(t: Any, y: Any, args: LorenzArgs) -> Any:
    """The derivative of `y`; `t` is not used."""
    del t
    x, y, z = y
    return jnp.stack([args.sigma * (y - x), x * (args.rho - z) - y, x * y - args.beta * z])
