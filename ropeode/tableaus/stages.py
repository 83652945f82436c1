"""What is common to methods made of stages: slopes that are added up with coefficients."""

from __future__ import annotations

import abc
import functools
from collections.abc import Sequence
from fractions import Fraction
from typing import Any, NamedTuple, Self

import numpy as np

Number = Fraction | float
Row = tuple[Number, ...]
Matrix = tuple[Row, ...]

# Coefficients that are no fractions are equal up to their last digits.
_SAME = 1e-12
# As large as the denominators of published methods (Dormand and Prince have 18656). Of the numbers
# that stand for no fraction, one in a hundred thousand is so close to one by accident.
_LARGEST = 100_000
# What is left of a coefficient when a step has multiplied and divided by it.
_ROUNDING = 8 * np.finfo(np.float64).eps


class Parts(NamedTuple):
    """The coefficients of a method by their kind.

    Fields:
        matrices: of the states where slopes are taken, ``(stages, stages)`` each.
        weights: of the slopes in the result, ``(stages,)`` each.
        columns: one number for each stage, ``(stages,)`` each: its time and the like.
    """

    matrices: tuple[Matrix, ...]
    weights: tuple[Row, ...]
    columns: tuple[Row, ...]


class Staged(abc.ABC):
    """A method that takes slopes and adds them up. Stages are counted from 0."""

    @property
    @abc.abstractmethod
    def parts(self) -> Parts:
        """Its coefficients by their kind."""

    @abc.abstractmethod
    def of_parts(self, parts: Parts) -> Self:
        """A method of the same kind with other coefficients."""

    @property
    def stages(self) -> int:
        """How many slopes it takes."""
        return len(self.parts.weights[0])

    @property
    def explicit(self) -> bool:
        """Whether each slope is taken with those before it alone."""
        matrices = self.parts.matrices
        return not any(any(row[i:]) for matrix in matrices for i, row in enumerate(matrix))

    @property
    def rational(self) -> bool:
        """Whether all coefficients are fractions."""
        matrices, weights, columns = self.parts
        rows = [row for matrix in matrices for row in matrix] + [*weights, *columns]
        return all(isinstance(entry, Fraction) for row in rows for entry in row)

    @property
    def unused(self) -> tuple[int, ...]:
        """The stages that the result does not depend on."""
        matrices, weights, _ = self.parts
        used = {i for row in weights for i, weight in enumerate(row) if weight}
        while (
            more := {
                j for matrix in matrices for i in used for j, entry in enumerate(matrix[i]) if entry
            }
            - used
        ):
            used |= more
        return tuple(i for i in range(self.stages) if i not in used)

    @functools.cached_property
    def equal_to(self) -> tuple[int, ...]:
        """For each stage the first one whose slope is taken at the same time and state."""
        matrices, _, columns = self.parts
        first: list[int] = []

        def place(i: int) -> Row:
            rows = [_merged(matrix[i], first) for matrix in matrices]
            return tuple(entry for row in rows for entry in row) + tuple(
                column[i] for column in columns
            )

        for i in range(self.stages):
            equals = (j for j in range(i) if all(map(same, place(i), place(j))))
            first.append(next(equals, i))
        return tuple(first)

    @functools.cached_property
    def reduced(self) -> Self:
        """The same method without stages that the result does not depend on, or that are equal.

        Source: Hairer, Wanner, Solving ODEs II, section IV.12, on reducible methods.
        """
        first = self.equal_to
        matrices, weights, columns = self.parts
        merged = Parts(
            tuple(tuple(_merged(row, first) for row in matrix) for matrix in matrices),
            tuple(_merged(row, first) for row in weights),
            columns,
        )
        unused = self.of_parts(merged).unused
        kept = [i for i in range(self.stages) if first[i] == i and i not in unused] or [0]
        if len(kept) == self.stages:
            return self

        def chosen(row: Row) -> Row:
            return tuple(row[i] for i in kept)

        fewer = Parts(
            tuple(tuple(chosen(matrix[i]) for i in kept) for matrix in merged.matrices),
            tuple(map(chosen, merged.weights)),
            tuple(map(chosen, columns)),
        )
        return self.of_parts(fewer).reduced


def _merged(row: Row, first: Sequence[int]) -> Row:
    """A row where entries of equal stages are added up in the first of these."""
    added: list[Number] = [Fraction(0)] * len(row)
    for j, entry in enumerate(row):
        if entry:
            added[first[j] if j < len(first) else j] += entry
    return tuple(added)


def number(value: Any) -> Number:
    """A coefficient: whole numbers, fractions and texts such as ``"1/6"`` are exact."""
    return Fraction(value) if isinstance(value, int | str | Fraction) else float(value)


def as_fraction(value: float) -> Number:
    """The fraction with a small denominator that a number is the rounding of; else the number.

    Arguments:
        value: a finite number; the nearest fraction must agree to the last bits.
    """
    fraction = Fraction(value).limit_denominator(_LARGEST)
    if abs(float(fraction) - value) <= _ROUNDING * max(abs(value), 0.125):
        return fraction
    return value


def same(one: Number, other: Number) -> bool:
    """Whether two coefficients are equal, up to the rounding of those that are no fractions."""
    if isinstance(one, Fraction) and isinstance(other, Fraction):
        return one == other
    return abs(float(one) - float(other)) <= _SAME * max(1.0, abs(float(one)), abs(float(other)))


def dot(row: Sequence[Number], column: Sequence[Number]) -> Number:
    """The scalar product, exact for fractions; terms that are 0 leave fractions as they are."""
    return sum((a * b for a, b in zip(row, column, strict=True) if a and b), Fraction(0))


def times(one: Row, other: Row) -> Row:
    """The product stage by stage."""
    return tuple(a * b for a, b in zip(one, other, strict=True))


def applied(matrix: Sequence[Row], column: Row) -> Row:
    """A matrix times a column."""
    return tuple(dot(row, column) for row in matrix)


def moduli(row: Row) -> Row:
    """The moduli of all entries."""
    return tuple(map(abs, row))


def ones(count: int) -> Row:
    """A row of ones."""
    return (Fraction(1),) * count
