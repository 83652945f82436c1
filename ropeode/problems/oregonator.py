"""The Oregonator: a reaction that changes its colour again and again."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from ropeode.problems.parameters import library_problem
from ropeode.problems.picture import logarithmic_plane
from ropeode.problems.problem import Problem
from ropeode.validation import Positive, WholePositive


class OregonatorArgs(NamedTuple):
    """The numbers in the equations."""

    s: Any
    q: Any
    w: Any


@library_problem(logarithmic_plane(0, 1, ("log10 y1", "log10 y2"), 1e-4))
def oregonator(frames: WholePositive = 20, duration: Positive = 360.0) -> Problem:
    """The reaction of Belousov and Zhabotinskii, with a limit cycle of steep flanks.

    ``y1' = s (y2 + y1 (1 - q y1 - y2))``, ``y2' = (y3 - (1 + y1) y2)/s``, ``y3' = w (y1 - y3)``
    with s = 77.27, q = 8.375e-6 and w = 0.161. The state has the shape (3,).

    Arguments:
        frames: number of equal intervals between sample times.
        duration: time that they cover together.

    Raises:
        InputError: one line for each argument that cannot be used.

    Source: Hairer and Wanner, Solving Ordinary Differential Equations II, section IV.10,
    equation (10.3), after Field and Noyes (1974).
    """
    return Problem(
        rhs,
        np.array([1.0, 2.0, 3.0]),
        np.linspace(0.0, duration, frames + 1),
        OregonatorArgs(s=77.27, q=8.375e-6, w=0.161),
        name="Oregonator",
    )


def rhs(t: Any, y: Any, args: OregonatorArgs) -> Any:
    """The rates of change of the three concentrations; `t` is not used."""
    del t
    a, b, c = y
    return jnp.stack(
        [
            args.s * (b + a * (1.0 - args.q * a - b)),
            (c - (1.0 + a) * b) / args.s,
            args.w * (a - c),
        ]
    )
