"""Numbers that are known up to a spread, as simple as it allows."""

from __future__ import annotations

_MOST_DIGITS = 6


def shortest(value: float, spread: float) -> float:
    """The decimal number with the fewest digits that is no further away than the spread."""
    if abs(value) <= spread:
        return 0.0
    texts = (f"{value:.{digits}e}" for digits in range(_MOST_DIGITS))
    return next((float(text) for text in texts if abs(float(text) - value) <= spread), value)


def shortest_factor(value: float, spread: float) -> float:
    """The simplest factor that is no further away than the spread: a decimal, or one over it."""
    decimal = shortest(value, spread)
    inverse = shortest(1.0 / value, spread / value**2)
    if inverse and len(f"{inverse:.6g}") < len(f"{decimal:.6g}"):
        return 1.0 / inverse
    return decimal
