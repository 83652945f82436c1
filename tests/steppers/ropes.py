"""A rope in space whose nodes differ in all that they may differ in, and move."""

from __future__ import annotations

import numpy as np

from ropeode.problems import InextensibleRope, Rope

SHAPE = {
    "start": (0.0, 0.0, 1.0),
    "end": (3.0, -1.0, 0.5),
    "num_nodes": 5,
    "node_mass": (1.0, 2.0, 0.5, 1.5, 0.7),
    "gravity": (0.3, -1.0, 0.2),
    "damping": (0.1, 0.2, 0.3, 0.4, 0.5),
}


def velocities(pinned):
    """Across the rope, so that no link is stretched."""
    rows = np.outer((0.5, 0.3, -0.2, 0.1, 0.4), (1.0, 3.0, 0.0))
    rows += np.outer((-0.3, 0.1, 0.2, 0.5, 0.0), (0.0, 0.5, -1.0))
    rows[list(pinned)] = 0.0
    return rows


def in_space(kind: type[Rope] | type[InextensibleRope], pinned=(1,), **given):
    """A rope of either kind, with other parameters where they are given."""
    moving = {"pinned": pinned, "initial_velocity": velocities(pinned)}
    return kind(**{**SHAPE, **moving, **given})


def sweep_links(x, lengths, lightness):
    """The assignment's loop: each link put back to its length in turn, in place.

    Arguments:
        x: positions, ``(nodes, dim)``.
        lengths: of the links.
        lightness: of each node, 1 over its mass, and 0 where it is pinned.
    """
    for i, rest in enumerate(lengths):
        a, b = lightness[i], lightness[i + 1]
        gap = x[i + 1] - x[i]
        excess = (1 - rest / np.linalg.norm(gap)) * gap / ((a + b) or 1.0)
        x[i] += a * excess
        x[i + 1] -= b * excess
