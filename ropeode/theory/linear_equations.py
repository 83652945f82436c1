"""The linear equations on which the stability of steppers is judged.

A step sees real arrays only. So a complex number ``a + ib`` acts as the real matrix
``[[a, -b], [b, a]]`` on pairs of numbers.
"""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from ropeode.problems import Problem
from ropeode.problems.links import LinearDamping


class Rate(NamedTuple):
    """The complex number lambda of ``y' = lambda y``."""

    real: Any
    imaginary: Any


class Spring(NamedTuple):
    """The numbers of ``x'' = -k x - rate x'`` with a complex k."""

    real: Any
    imaginary: Any
    rate: Any


@functools.cache
def first_order() -> Problem:
    """``y' = lambda y``; its state is ``(2,)``, its frame 1."""
    return Problem(
        _decay, np.array([1.0, 0.5]), np.arange(2.0), Rate(-1.0, 1.0), name="y' = lambda y"
    )


@functools.cache
def second_order() -> Problem:
    """``x'' = -k x - rate x'``; its positions are one node of two components, its frame 1."""
    return Problem.second_order(
        _pull,
        [[1.0, 0.5]],
        [[0.0, 0.0]],
        [0.0, 1.0],
        Spring(1.0, 0.0, 0.0),
        damping=_damping,
        name="x'' = -k x - rate x'",
    )


def _turned(real: Any, imaginary: Any, y: Any) -> Any:
    """The product with a complex number; pairs stand on the last axis."""
    return real * y + imaginary * jnp.stack([-y[..., 1], y[..., 0]], axis=-1)


def _decay(t: Any, y: Any, args: Rate) -> Any:
    del t
    return _turned(args.real, args.imaginary, y)


def _pull(t: Any, x: Any, v: Any, args: Spring) -> Any:
    del t
    return -_turned(args.real, args.imaginary, x) - args.rate * v


def _damping(args: Spring) -> LinearDamping:
    # The mass is 1.
    return LinearDamping(args.rate, args.rate)


def rates(z: np.ndarray) -> np.ndarray:
    """The `args` of ``y' = z y``, one row for each, ``(numbers, 2)``."""
    z = np.asarray(z, dtype=complex)
    return np.stack([np.real(z), np.imag(z)], axis=-1)


def springs(z: np.ndarray, other: np.ndarray) -> np.ndarray:
    """The `args` of the spring whose motions are ``exp(z t)`` and ``exp(other t)``.

    Arguments:
        z, other: the two roots, whose sum is real, ``(numbers,)``.

    Returns:
        One row for each pair, ``(numbers, 3)``.
    """
    k = np.asarray(z, dtype=complex) * other
    return np.stack([np.real(k), np.imag(k), -np.real(z + np.asarray(other))], axis=-1)
