"""At which nodes, along which axes and beyond which threshold a step is off, in words."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ropeode.theory.expansion import Expansion
from ropeode.theory.terms import AXES, along_axes
from ropeode.validation import numbered

# How many states must be on each side of a threshold.
_SOME = 3


def where_off(expansions: Sequence[Expansion], sizes: Sequence[np.ndarray], least: float) -> str:
    """In words, at which free nodes, along which axes or beyond what something is large.

    The words are empty where it is so everywhere, or at pinned nodes alone.

    Arguments:
        expansions: of the step, on each rope.
        sizes: of that, at the states of each, ``(states, nodes, dim)``.
        least: what is large.
    """
    free = [np.flatnonzero(each.problem.args.free) for each in expansions]
    every = [size[:, some] > least for size, some in zip(sizes, free, strict=True)]
    there = [np.any(each, axis=2) for each in every]
    of_node, off = (np.concatenate([np.ravel(each) for each in of]) for of in (free, there))
    some = np.concatenate([np.any(each, axis=0) for each in there])
    nodes, at_nodes = sorted(set(of_node[some].tolist())), ""
    if nodes and nodes != sorted(set(of_node.tolist())):
        at_nodes = f", at {numbered('node', nodes)} alone"
    # Beyond a threshold some states of a node are off, and others are not.
    if at_nodes and np.array_equal(some, np.concatenate([np.all(each, axis=0) for each in there])):
        return at_nodes
    numbers = [_numbers_of_nodes(*pair) for pair in zip(expansions, free, strict=True)]
    if _SOME <= np.sum(off) <= len(off) - _SOME:
        for name in numbers[0]:
            values = np.concatenate([np.ravel(each[name]) for each in numbers])
            here, elsewhere = values[off], values[~off]
            for side, low, high in (("below", here, elsewhere), ("above", elsewhere, here)):
                if np.max(low) < np.min(high):
                    between = f"between {np.max(low):.3g} and {np.min(high):.3g}"
                    return f", only where {name} is {side} a number {between}"
    axes = np.any([np.any(each, axis=(0, 1)) for each in every], axis=0)
    return at_nodes or along_axes(axes)


def _numbers_of_nodes(expansion: Expansion, nodes: np.ndarray) -> dict[str, np.ndarray]:
    """The numbers that a threshold may be one of, ``(states, nodes)`` each, by name."""
    (x, v), a = np.moveaxis(expansion.y[:, :, nodes], 1, 0), expansion.slopes[:, 1, nodes]
    force = expansion.problem.args.mass[nodes, None] * a
    return {
        **{f"the node's {axis}": x[:, :, i] for i, axis in enumerate(AXES[: x.shape[2]])},
        "the node's speed": np.linalg.norm(v, axis=2),
        "a component of the node's velocity": np.max(np.abs(v), axis=2),
        "the force on the node": np.linalg.norm(force, axis=2),
        "a component of the force on the node": np.max(np.abs(force), axis=2),
        "a component of the node's acceleration": np.max(np.abs(a), axis=2),
        "t": np.broadcast_to(expansion.t[:, None], x.shape[:2]),
    }
