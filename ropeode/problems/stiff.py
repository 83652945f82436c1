"""Stiff problems: a circuit that swings by itself, and three chemical reactions."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from ropeode.problems.parameters import library_problem
from ropeode.problems.picture import Picture, logarithmic_plane, plane
from ropeode.problems.problem import Problem
from ropeode.validation import Finite, Positive, WholePositive


@library_problem(plane(0, 1, ("x", "x'")))
def van_der_pol(
    frames: WholePositive = 20,
    duration: Positive = 2.0,
    epsilon: Positive = 0.1,
    x0: Finite = 2.0,
    v0: Finite = 0.0,
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
    return Problem.second_order(
        van_der_pol_acceleration,
        [[x0]],
        [[v0]],
        np.linspace(0.0, duration, frames + 1),
        epsilon,
        name="Van der Pol",
    )


def van_der_pol_acceleration(t: Any, x: Any, v: Any, epsilon: Any) -> Any:
    """Damping that drives small swings, and a spring; `t` is not used."""
    del t
    return ((1.0 - x * x) * v - x) / epsilon


def _robertson_scaled(times: np.ndarray, states: np.ndarray, args: Any) -> np.ndarray:
    """The first substance, and the second, of which there is never much more than 1e-5."""
    del times, args
    return (states[:, [0, 1]] * [1.0, 1e5])[:, None]


@library_problem(Picture("phase", _robertson_scaled, ("y1", "1e5 y2")))
def robertson(frames: WholePositive = 12, duration: Positive = 1e11) -> Problem:
    """Three substances; the second decays almost as soon as it forms.

    ``y1' = -0.04 y1 + 1e4 y2 y3``, ``y3' = 3e7 y2^2``, and the sum stays 1. The state has the
    shape (3,). Each frame but the first ends at ten times the time at which the one before
    ended.

    Arguments:
        frames: number of intervals between sample times.
        duration: time at which the last one ends.

    Raises:
        InputError: one line for each argument that cannot be used.

    Source: Hairer and Wanner, Solving Ordinary Differential Equations II, section IV.1,
    equation (1.4), after Robertson (1966).
    """
    return Problem(
        robertson_rhs,
        np.array([1.0, 0.0, 0.0]),
        np.append(0.0, duration / 10.0 ** np.arange(frames - 1, -1, -1)),
        name="Robertson",
    )


def robertson_rhs(t: Any, y: Any, args: Any) -> Any:
    """The rates of change of the three concentrations; only `y` is used."""
    del t, args
    slow, back, fast = 0.04 * y[0], 1e4 * y[1] * y[2], 3e7 * y[1] * y[1]
    return jnp.stack([back - slow, slow - back - fast, fast])


@library_problem(plane(4, 5, ("y5", "y6")))
def hires(frames: WholePositive = 20, duration: Positive = 321.8122) -> Problem:
    """The high irradiance response of a plant, a stiff reaction of eight substances.

    The state has the shape (8,).

    Arguments:
        frames: number of equal intervals between sample times.
        duration: time that they cover together.

    Raises:
        InputError: one line for each argument that cannot be used.

    Source: Hairer and Wanner, Solving Ordinary Differential Equations II, section IV.10,
    equation (10.4), after Schäfer (1975).
    """
    return Problem(
        hires_rhs,
        np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0057]),
        np.linspace(0.0, duration, frames + 1),
        name="HIRES",
    )


def hires_rhs(t: Any, y: Any, args: Any) -> Any:
    """The rates of change of the eight concentrations; only `y` is used."""
    del t, args
    bound = 280.0 * y[5] * y[7]
    return jnp.stack(
        [
            -1.71 * y[0] + 0.43 * y[1] + 8.32 * y[2] + 0.0007,
            1.71 * y[0] - 8.75 * y[1],
            -10.03 * y[2] + 0.43 * y[3] + 0.035 * y[4],
            8.32 * y[1] + 1.71 * y[2] - 1.12 * y[3],
            -1.745 * y[4] + 0.43 * y[5] + 0.43 * y[6],
            -bound + 0.69 * y[3] + 1.71 * y[4] - 0.43 * y[5] + 0.69 * y[6],
            bound - 1.81 * y[6],
            -bound + 1.81 * y[6],
        ]
    )


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
        oregonator_rhs,
        np.array([1.0, 2.0, 3.0]),
        np.linspace(0.0, duration, frames + 1),
        OregonatorArgs(s=77.27, q=8.375e-6, w=0.161),
        name="Oregonator",
    )


def oregonator_rhs(t: Any, y: Any, args: OregonatorArgs) -> Any:
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
