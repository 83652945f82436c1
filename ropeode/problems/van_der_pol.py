"""Van der Pol's oscillator, stiff or not."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ropeode.problems.problem import Problem
from ropeode.validation import Finite, Input, Positive, WholePositive, field


class VanDerPolArgs(NamedTuple):
    """The number in the equation."""

    epsilon: Any


class _Arguments(Input):
    """The arguments of `van_der_pol`, checked."""

    frames: WholePositive = field(..., allowed="a whole number >= 1", example="20")
    duration: Positive = field(..., allowed="a finite number > 0", example="2.0")
    epsilon: Positive = field(..., allowed="a finite number > 0", example="1e-6")
    x0: Finite = field(..., allowed="a finite number", example="2.0")
    v0: Finite = field(..., allowed="a finite number", example="0.0")


def van_der_pol(
    frames: int = 20,
    duration: float = 2.0,
    epsilon: float = 0.1,
    x0: float = 2.0,
    v0: float = 0.0,
) -> Problem:
    """A circuit that swings by itself, ``epsilon x'' = (1 - x^2) x' - x``.

    With ``mu = 1/sqrt(epsilon)`` and time in units of mu this is ``x'' = mu (1 - x^2) x' - x``.
    An epsilon of 1e-6 makes the well-known stiff problem. Positions have the shape (1, 1).

    Arguments:
        frames: number of equal intervals between sample times.
        duration: time that they cover together.
        epsilon: how fast the fast part is.
        x0: at the start.
        v0: its derivative at the start.

    Raises:
        InputError: one line for each argument that cannot be used.

    Source: Hairer and Wanner, Solving Ordinary Differential Equations II, section IV.1,
    equation (1.5').
    """
    checked = _Arguments(frames=frames, duration=duration, epsilon=epsilon, x0=x0, v0=v0)
    return Problem.second_order(
        acceleration,
        [[checked.x0]],
        [[checked.v0]],
        np.linspace(0.0, checked.duration, checked.frames + 1),
        VanDerPolArgs(checked.epsilon),
        name="Van der Pol",
        parameters={"kind": "van-der-pol", **checked.model_dump(mode="json")},
    )


def acceleration(t: Any, x: Any, v: Any, args: VanDerPolArgs) -> Any:
    """Damping that drives small swings, and a spring; `t` is not used."""
    del t
    return ((1.0 - x * x) * v - x) / args.epsilon
