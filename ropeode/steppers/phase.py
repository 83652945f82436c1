"""Positions and velocities as one vector, without being stored as one array."""

from __future__ import annotations

from typing import Any, NamedTuple


class Phase(NamedTuple):
    """A point ``(x, v)`` of phase space that adds and scales like a vector.

    Steppers written for any ODE (``y + dt * k``) run on it unchanged, while XLA keeps the
    two arrays apart; stacking them inside the step costs two to four times the run time.
    """

    x: Any
    v: Any

    def __add__(self, other: Phase) -> Phase:  # type: ignore[override]
        """The sum, component by component (not the concatenation of tuples)."""
        return Phase(self.x + other.x, self.v + other.v)

    def __mul__(self, factor: Any) -> Phase:  # type: ignore[override]
        """The product with a number."""
        return Phase(factor * self.x, factor * self.v)

    __rmul__ = __mul__  # type: ignore[assignment]
