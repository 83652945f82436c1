"""Rooted trees with coloured nodes: each stands for one order condition.

The tree of an elementary differential has a node for each factor; its colour says which function
that factor is a derivative of. A right-hand side f(t, y) has nodes of colour y, and leaves of
colour t where it is differentiated by time. An acceleration a(t, x, v) has nodes of colour v
(factors a), of colour x (factors x' = v) and leaves of colour t.

Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, sections II.2 (trees),
II.14 (Nystrom methods) and II.15 (P-series).
"""

from __future__ import annotations

import collections
import functools
import itertools
import math
from collections.abc import Iterator
from fractions import Fraction
from typing import Any, NamedTuple

# Which colours the branches of a node may have.
FIRST_ORDER = {"y": ("y", "t"), "t": ()}
SECOND_ORDER = {"v": ("v", "x", "t"), "x": ("v",), "t": ()}


class Tree(NamedTuple):
    """A rooted tree.

    Fields:
        colour: of the root.
        branches: the trees on its root, sorted.
    """

    colour: str
    branches: tuple[Tree, ...] = ()

    @property
    def order(self) -> int:
        """How many nodes it has."""
        return 1 + sum(branch.order for branch in self.branches)

    @property
    def density(self) -> int:
        """``gamma``: the exact flow has the weight ``1 / gamma``."""
        return self.order * math.prod(branch.density for branch in self.branches)

    @property
    def symmetry(self) -> int:
        """``sigma``: the size of the tree's group of symmetries."""
        counts = collections.Counter(self.branches)
        return math.prod(
            math.factorial(count) * branch.symmetry**count for branch, count in counts.items()
        )


def trees_of_order(order: int, colours: dict[str, tuple[str, ...]], root: str) -> tuple[Tree, ...]:
    """All trees with so many nodes.

    Arguments:
        order: how many nodes.
        colours: which colours the branches of a node may have, by its colour.
        root: the colour of the root.
    """
    found = {
        tree: None for shape in _shapes(order) for tree in _coloured(shape, root, _frozen(colours))
    }
    return tuple(found)


@functools.cache
def _shapes(order: int) -> tuple[Any, ...]:
    """Trees without colours: each is the tuple of its branches."""
    return tuple(_forests(order - 1, order - 1))


def _forests(nodes: int, largest: int) -> Iterator[tuple[Any, ...]]:
    """All multisets of shapes with so many nodes together, and not more in any of them."""
    if nodes == 0:
        yield ()
    for size in range(min(nodes, largest), 0, -1):
        for count in range(1, nodes // size + 1):
            for chosen in itertools.combinations_with_replacement(_shapes(size), count):
                for smaller in _forests(nodes - size * count, size - 1):
                    yield (*chosen, *smaller)


def _frozen(colours: dict[str, tuple[str, ...]]) -> tuple[tuple[str, tuple[str, ...]], ...]:
    return tuple(colours.items())


@functools.cache
def _coloured(
    shape: Any, colour: str, colours: tuple[tuple[str, tuple[str, ...]], ...]
) -> tuple[Tree, ...]:
    """A shape with all colours that its nodes may have, given that of the root."""
    allowed = dict(colours)[colour]
    # x' = v is linear: its derivatives by v are those of order 0 and 1.
    if shape and (not allowed or (colour == "x" and len(shape) > 1)):
        return ()
    choices = [
        [tree for other in allowed for tree in _coloured(branch, other, colours)]
        for branch in shape
    ]
    found = {Tree(colour, tuple(sorted(chosen))): None for chosen in itertools.product(*choices)}
    return tuple(found)


def formula(tree: Tree, row_sums: str = "c") -> str:
    """The order condition of a tree of colours y and t, as in ``Σ b_i c_i a_ij c_j = 1/8``.

    Arguments:
        tree: of the condition.
        row_sums: what the sums ``Σ_j a_ij`` are called, which leaves of colour y stand for. Those
            of colour t stand for the times c_i.
    """
    letters = iter("jklmnopqrstuvwxyz")
    factors = "".join(_factors(tree, "i", letters, row_sums))
    return f"Σ b_i{factors} = {Fraction(1, tree.density)}"


def _factors(tree: Tree, index: str, letters: Iterator[str], row_sums: str) -> Iterator[str]:
    for name, leaf in ((row_sums, Tree("y")), ("c", Tree("t"))):
        count = tree.branches.count(leaf)
        if count:
            yield f" {name}_{index}" + (f"^{count}" if count > 1 else "")
    for branch in tree.branches:
        if branch.branches:
            other = next(letters)
            yield f" a_{index}{other}"
            yield from _factors(branch, other, letters, row_sums)
