"""Runge-Kutta methods as their coefficients."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from typing import Any, NamedTuple, Self

import numpy as np

from ropeode.tableaus.order_conditions import Method
from ropeode.tableaus.rooted_trees import FIRST_ORDER, Tree, formula, trees_of_order
from ropeode.tableaus.stages import (
    Matrix,
    Number,
    Parts,
    Row,
    applied,
    dot,
    moduli,
    number,
    ones,
    same,
)
from ropeode.validation import bad_value

# The equations of an implicit step are solved within as many iterations, or not at all; the last
# bits may go to and fro.
_ITERATIONS = 200
_SOLVED = 16 * np.finfo(np.float64).eps


class SimplifyingAssumptions(NamedTuple):
    """The largest p, q and r for which B(p), C(q) and D(r) hold.

    Fields:
        b: ``Σ b_i c_i^(k-1) = 1/k`` for k = 1 ... p.
        c: ``Σ_j a_ij c_j^(k-1) = c_i^k / k`` for each i and k = 1 ... q.
        d: ``Σ_i b_i c_i^(k-1) a_ij = b_j (1 - c_j^k) / k`` for each j and k = 1 ... r.
    """

    b: int
    c: int
    d: int


class StabilityFunction(NamedTuple):
    """``R(z)``: on ``y' = lambda y`` a step multiplies y by ``R(lambda dt)``.

    Fields:
        numerator, denominator: coefficients of 1, z, z^2, ...; exact for fractions. The
            denominator of an explicit method is ``(1,)``.
    """

    numerator: Row
    denominator: Row

    def __call__(self, z: Any) -> Any:
        """The values at complex numbers `z`."""
        above, below = (
            np.polynomial.polynomial.polyval(z, np.array(row, dtype=float)) for row in self
        )
        return above / below


@dataclasses.dataclass(frozen=True)
class Tableau(Method):
    """A Runge-Kutta method: ``k_i = f(t + c_i dt, y + dt Σ a_ij k_j)``, ``y += dt Σ b_i k_i``.

    Arguments:
        a: the matrix, as rows; fractions where they are known exactly.
        b: the weights.
        c: the times of the slopes, in units of dt. Those of a proper method are the row sums of a.

    Source: Hairer, Norsett, Wanner, Solving ODEs I, definitions II.1.1 and II.7.1.
    """

    a: Matrix
    b: Row
    c: Row

    def __post_init__(self) -> None:
        if not self.b or {len(self.a), len(self.c), *map(len, self.a)} != {len(self.b)}:
            raise bad_value(
                "tableau",
                f"rows of {', '.join(str(len(row)) for row in self.a)} entries, {len(self.b)} "
                f"weights and {len(self.c)} times",
                "a square matrix, with a weight and a time for each row",
                "write the zeros too, or use Tableau.of",
            )

    @classmethod
    def of(
        cls, a: Sequence[Sequence[Any]], b: Sequence[Any], c: Sequence[Any] | None = None
    ) -> Tableau:
        """A tableau from numbers: whole ones, fractions and texts such as ``"1/6"`` are exact.

        Arguments:
            a: the rows; those of an explicit method may end before their zeros.
            b: the weights.
            c: the times; the row sums of `a` by default.
        """
        rows = tuple(tuple(map(number, row)) + (Fraction(0),) * (len(b) - len(row)) for row in a)
        times = tuple(map(number, c)) if c is not None else tuple(_sum(row) for row in rows)
        return cls(rows, tuple(map(number, b)), times)

    @property
    def parts(self) -> Parts:
        """Its coefficients by their kind."""
        return Parts((self.a,), (self.b,), (self.c,))

    def of_parts(self, parts: Parts) -> Self:
        """A tableau with other coefficients."""
        (a,), (b,), (c,) = parts
        return dataclasses.replace(self, a=a, b=b, c=c)

    @property
    def row_sums(self) -> Row:
        """``Σ_j a_ij``: the times that go with the matrix, ``(stages,)``."""
        return tuple(map(_sum, self.a))

    @property
    def keeps_time(self) -> bool:
        """Whether the times c are the row sums, so that time is like any other component."""
        return all(map(same, self.c, self.row_sums))

    def trees(self, order: int) -> Iterator[Tree]:
        """The trees of its conditions with so many nodes."""
        yield from trees_of_order(order, {"y": ("y",)} if self.keeps_time else FIRST_ORDER, "y")

    def branch(self, tree: Tree, in_moduli: bool) -> Row:
        """The factor that a branch gives to the weight of each stage, ``(stages,)``."""
        if tree.colour == "t":
            return moduli(self.c) if in_moduli else self.c
        matrix = tuple(map(moduli, self.a)) if in_moduli else self.a
        return applied(matrix, self.stage_weights(tree, in_moduli))

    def weight(self, tree: Tree, in_moduli: bool = False) -> Number:
        """The elementary weight of a tree."""
        return dot(moduli(self.b) if in_moduli else self.b, self.stage_weights(tree, in_moduli))

    def condition(self, tree: Tree) -> str:
        """The order condition of a tree as a formula, as in ``Σ b_i c_i = 1/2``.

        Where the times c are not the row sums of a, those are called r.
        """
        return formula(tree, "c" if self.keeps_time else "r")

    @functools.cached_property
    def order_without_time(self) -> int:
        """The order on right-hand sides that do not depend on time."""
        return dataclasses.replace(self, c=self.row_sums).order

    @functools.cached_property
    def simplifying_assumptions(self) -> SimplifyingAssumptions:
        """Which of Butcher's B(p), C(q) and D(r) hold.

        Source: Hairer, Wanner, Solving ODEs II, section IV.5.
        """
        columns = tuple(zip(*self.a, strict=True))

        def powers(k: int) -> Row:
            return tuple(c**k for c in self.c)

        def b_holds(k: int) -> bool:
            return same(dot(self.b, powers(k - 1)), Fraction(1, k))

        def c_holds(k: int) -> bool:
            left = applied(self.a, powers(k - 1))
            return all(map(same, left, (power / k for power in powers(k))))

        def d_holds(k: int) -> bool:
            weighted = tuple(b * power for b, power in zip(self.b, powers(k - 1), strict=True))
            right = (b * (1 - power) / k for b, power in zip(self.b, powers(k), strict=True))
            return all(map(same, applied(columns, weighted), right))

        def largest(holds: Callable[[int], bool]) -> int:
            # A quadrature with s nodes has order 2 s at most.
            return next(k for k in range(1, 2 * self.stages + 2) if not holds(k)) - 1

        return SimplifyingAssumptions(largest(b_holds), largest(c_holds), largest(d_holds))

    @functools.cached_property
    def stability_function(self) -> StabilityFunction:
        """``R(z) = det(I - z A + z 1 b^T) / det(I - z A)``.

        Source: Hairer, Wanner, Solving ODEs II, proposition IV.3.2.
        """
        own = self.reduced
        if own.explicit:
            column, coefficients = ones(own.stages), [Fraction(1)]
            for _ in range(own.stages):
                coefficients.append(dot(own.b, column))  # type: ignore[arg-type]
                column = applied(own.a, column)
            return StabilityFunction(_trimmed(coefficients), ones(1))
        above = tuple(
            tuple(entry - b for entry, b in zip(row, own.b, strict=True)) for row in own.a
        )
        return StabilityFunction(_determinant(above), _determinant(own.a))

    def step(self, f: Callable[[float, np.ndarray], Any], t: float, y: Any, dt: float) -> Any:
        """The state after one step, by the definition.

        An implicit method's equations are solved by fixed-point iteration, which converges where
        dt times the Lipschitz constant of f is small.

        Arguments:
            f: the right-hand side ``f(t, y)``.
            t: time.
            y: state, an array.
            dt: step size.

        Returns:
            The new state; not-a-number where the iteration does not converge.
        """
        a, b, c = (np.array(each, dtype=float) for each in (self.a, self.b, self.c))
        k = np.zeros((self.stages, *np.shape(y)))
        for _ in range(_ITERATIONS):
            before = k.copy()
            for i in range(self.stages):
                k[i] = f(t + c[i] * dt, y + dt * np.tensordot(a[i], k, 1))
            if self.explicit or np.max(np.abs(k - before)) <= _SOLVED * np.max(np.abs(k)):
                return y + dt * np.tensordot(b, k, 1)
        return np.full_like(y, np.nan)


def _sum(row: Row) -> Number:
    return dot(row, ones(len(row)))


def _trimmed(coefficients: Sequence[Number]) -> Row:
    """A polynomial's coefficients without the last ones, which are 0."""
    length = max(k for k, coefficient in enumerate(coefficients) if coefficient) + 1
    return tuple(coefficients[:length])


def _determinant(matrix: Matrix) -> Row:
    """``det(I - z M)`` as a polynomial in z, by the method of Faddeev and LeVerrier."""
    size = len(matrix)
    columns = tuple(tuple(Fraction(int(i == j)) for i in range(size)) for j in range(size))
    coefficients: list[Number] = [Fraction(1)]
    for k in range(1, size + 1):
        products = tuple(applied(matrix, column) for column in columns)
        last = -sum((products[i][i] for i in range(size)), Fraction(0)) / k
        coefficients.append(last)
        columns = tuple(
            tuple(entry + last if i == j else entry for i, entry in enumerate(column))
            for j, column in enumerate(products)
        )
    return _trimmed(coefficients)
