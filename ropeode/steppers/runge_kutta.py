"""Explicit Runge-Kutta methods, one for each tableau."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from fractions import Fraction
from typing import Any, ClassVar

from ropeode.steppers.base import BuiltIn, ProblemClass, System
from ropeode.tableaus import Tableau
from ropeode.tableaus.stages import Row

# A slope that more than so many sums read is stored; for fewer it takes longer to store it.
_READERS = 3
# Whole numbers up to here are floating-point numbers too.
_EXACT = 2**53


@dataclasses.dataclass(frozen=True)
class RungeKutta(BuiltIn):
    """``k_i = f(t + c_i dt, y + dt Σ a_ij k_j)``, then ``y += dt Σ b_i k_i``.

    Subclasses have an explicit tableau, and the order of which it meets the conditions: that is
    found too slowly to be asked for each time. Coefficients that are 0, and stages that the result
    does not depend on, cost nothing.

    Source: Hairer, Norsett, Wanner, Solving ODEs I, definition II.1.1.
    """

    tableau: ClassVar[Tableau]
    tableau_order: ClassVar[int]

    family = "Runge-Kutta"

    def order(self, problem_class: ProblemClass) -> int:
        """That of the tableau, on every problem."""
        return self.tableau_order

    def step(self, system: System, t: Any, y: Any, dt: Any) -> Any:
        """One slope after the other, and then their weighted sum."""
        tableau = self.tableau.reduced
        slopes: list[Any] = []
        for i, (row, c) in enumerate(zip(tableau.a, tableau.c, strict=True)):
            state = advanced(y, dt, row[:i], slopes)
            slope = system.rhs(t + dt * float(c) if c else t, state)
            readers = sum(bool(other[i]) for other in (*tableau.a, tableau.b))
            slopes.append(system.once(slope) if readers > _READERS else slope)
        return advanced(y, dt, tableau.b, slopes)


def advanced(y: Any, dt: Any, row: Row, slopes: Sequence[Any]) -> Any:
    """``y + dt Σ row_j slopes_j`` without terms that are 0.

    Fractions are whole numbers over a common denominator, as in ``dt/6 (k1 + 2 k2 + 2 k3 + k4)``.

    Arguments:
        y: a state.
        dt: step size.
        row: coefficients.
        slopes: as many.
    """
    denominator = _common_denominator(row)
    terms = [
        slope if entry * denominator == 1 else float(entry * denominator) * slope
        for entry, slope in zip(row, slopes, strict=True)
        if entry
    ]
    if not terms:
        return y
    return y + dt / denominator * sum(terms[1:], start=terms[0])


def _common_denominator(row: Row) -> int:
    """1 where there is none, or where the whole numbers would have to be rounded."""
    if not all(isinstance(entry, Fraction) for entry in row):
        return 1
    common = math.lcm(*(Fraction(entry).denominator for entry in row))
    return common if all(abs(entry * common) < _EXACT for entry in (1, *row)) else 1
