"""The order of a method from its coefficients, by conditions on rooted trees."""

from __future__ import annotations

import abc
import functools
import math
from collections.abc import Iterator
from fractions import Fraction
from typing import NamedTuple

from ropeode.tableaus.rooted_trees import Tree
from ropeode.tableaus.stages import Number, Row, Staged, ones, times

# Coefficients that are no fractions carry the rounding of their last digit.
_ROUNDING = 1e-13
# No method in use has a higher order than that.
_HIGHEST = 20


class TreeError(NamedTuple):
    """How far a method is from one order condition.

    Fields:
        tree: of the condition.
        weight: of the method, its elementary weight ``Phi(tree)``.
        exact: of the flow, ``1 / gamma(tree)``.
        coefficient: of ``dt**order F(tree)(y)`` in the local error (numerical less exact), where
            F is the elementary differential: ``(weight - exact) / sigma(tree)``.
        met: whether the two weights are equal: exactly for fractions, else up to rounding.
    """

    tree: Tree
    weight: Number
    exact: Fraction
    coefficient: Number
    met: bool


class Method(Staged):
    """A method that has an elementary weight for each rooted tree."""

    @abc.abstractmethod
    def trees(self, order: int) -> Iterator[Tree]:
        """The trees of its conditions with so many nodes."""

    @abc.abstractmethod
    def branch(self, tree: Tree, in_moduli: bool) -> Row:
        """The factor that a branch gives to the weight of each stage, ``(stages,)``.

        Arguments:
            tree: the branch.
            in_moduli: whether all coefficients are replaced by their moduli.
        """

    @abc.abstractmethod
    def weight(self, tree: Tree, in_moduli: bool = False) -> Number:
        """The elementary weight of a tree."""

    def stage_weights(self, tree: Tree, in_moduli: bool) -> Row:
        """The elementary weights of the stages, ``(stages,)``.

        Source: Hairer, Norsett, Wanner, Solving ODEs I, definition II.2.9.
        """
        known, key = self._stage_weights, (tree, in_moduli)
        if key not in known:
            factors = (self.branch(branch, in_moduli) for branch in tree.branches)
            known[key] = functools.reduce(times, factors, ones(self.stages))
        return known[key]

    @functools.cached_property
    def _stage_weights(self) -> dict[tuple[Tree, bool], Row]:
        """Those that were computed: most trees are branches of larger ones."""
        return {}

    def errors(self, order: int) -> tuple[TreeError, ...]:
        """How far it is from each condition of an order: for each tree with so many nodes."""
        return tuple(map(self._error, self.trees(order)))

    def _error(self, tree: Tree) -> TreeError:
        weight, exact = self.weight(tree), Fraction(1, tree.density)
        difference = weight - exact
        if isinstance(weight, Fraction):
            met = difference == 0
        else:
            met = abs(difference) <= _ROUNDING * max(float(self.weight(tree, True)), 1.0)
        return TreeError(tree, weight, exact, difference / tree.symmetry, met)

    @functools.cached_property
    def order(self) -> int:
        """Up to how many nodes all conditions are met; 0 for a method that does not converge."""
        orders = range(1, _HIGHEST)
        return next(p for p in orders if not all(each.met for each in self.errors(p))) - 1

    @property
    def error_coefficients(self) -> tuple[TreeError, ...]:
        """The local error's leading term, tree by tree: the trees with ``order + 1`` nodes."""
        return self.errors(self.order + 1)

    @property
    def principal_error_norm(self) -> float:
        """The 2-norm of the leading term's coefficients.

        Source: Prince, Dormand, J. Comput. Appl. Math. 7 (1981), 67-75.
        """
        return math.hypot(*(float(each.coefficient) for each in self.error_coefficients))
