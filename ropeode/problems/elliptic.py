"""Elliptic functions in extended precision, which SciPy has in float64 only."""

from __future__ import annotations

from typing import Any

import numpy as np

# The arithmetic-geometric mean doubles its digits with each round; it has to get near first
# where the complementary parameter is tiny.
_MOST_ROUNDS = 60
_NEAR = 2.0 * np.finfo(np.longdouble).eps
# Carlson's series is broken off at the fourth power of what this leaves.
_CARLSON_NEAR = 2e-4


def first_kind(sine: Any, cosine: Any, delta: Any) -> np.longdouble:
    """The integral of the first kind, F(phi, m), for ``phi`` from -pi/2 to pi/2.

    Arguments:
        sine: of phi.
        cosine: of phi, not below zero.
        delta: ``sqrt(1 - m sin(phi)^2)``.

    Source: Carlson, Numerical computation of real or complex elliptic integrals, Numerical
    Algorithms 10 (1995), equations (2.1), (2.6) to (2.10) and (4.5).
    """
    sine, cosine, delta = (np.longdouble(value) for value in (sine, cosine, delta))
    x, y, z = cosine * cosine, delta * delta, np.longdouble(1)
    while True:
        mean = (x + y + z) / 3
        off = [1 - each / mean for each in (x, y, z)]
        if max(abs(each) for each in off) < _CARLSON_NEAR:
            break
        a, b, c = np.sqrt(x), np.sqrt(y), np.sqrt(z)
        shift = a * b + b * c + c * a
        x, y, z = (x + shift) / 4, (y + shift) / 4, (z + shift) / 4
    second = off[0] * off[1] - off[2] * off[2]
    third = off[0] * off[1] * off[2]
    series = 1 - second / 10 + third / 14 + second * second / 24 - 3 * second * third / 44
    return sine * series / np.sqrt(mean)


def amplitude(u: Any, complement: Any) -> np.ndarray:
    """Jacobi's amplitude am(u, m), which grows by pi for each two quarter periods.

    Arguments:
        u: any shape.
        complement: ``1 - m``, above zero.

    Source: Abramowitz and Stegun, Handbook of Mathematical Functions, 16.4.
    """
    means, differences = _means(complement)
    phi = np.asarray(u, dtype=np.longdouble) * means[-1] * 2 ** (len(means) - 1)
    for mean, difference in zip(means[:0:-1], differences[:0:-1], strict=True):
        phi = (phi + np.arcsin(difference / mean * np.sin(phi))) / 2
    return phi


def _means(complement: Any) -> tuple[list[np.longdouble], list[np.longdouble]]:
    """The arithmetic means, and half the differences, on the way to the common mean."""
    complement = np.longdouble(complement)
    a, b = np.longdouble(1), np.sqrt(complement)
    means, differences = [a], [np.sqrt(1 - complement)]
    for _ in range(_MOST_ROUNDS):
        a, b, c = (a + b) / 2, np.sqrt(a * b), (a - b) / 2
        means.append(a)
        differences.append(c)
        if c <= _NEAR * a:
            break
    return means, differences
