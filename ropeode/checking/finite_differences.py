"""Derivatives by finite differences."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

# For differences of fourth order: truncation and rounding are both about 1e-12 of the scale.
_H = 1e-3


def jacobian(
    function: Callable[[np.ndarray], np.ndarray], y: np.ndarray, scale: float
) -> np.ndarray:
    """The derivative of a function of a vector, ``(outputs, inputs)``.

    Central differences of fourth order. They need only values, so the function may be in any
    language.

    Arguments:
        function: of a vector.
        y: the point.
        scale: of the components of `y`.
    """
    h = _H * scale
    columns = []
    for i in range(len(y)):
        direction = np.zeros(len(y))
        direction[i] = h
        near = function(y + direction) - function(y - direction)
        far = function(y + 2 * direction) - function(y - 2 * direction)
        columns.append((8.0 * near - far) / (12.0 * h))
    return np.stack(columns, axis=1)
