"""What rigid links are to the velocities of their nodes; shares nothing with the package."""

from __future__ import annotations

import numpy as np


def stretching(x):
    """For each link what node velocities stretch it: ``d . (v_b - v_a)``; ``x`` is ``(n, dim)``."""
    nodes, dim = x.shape
    rows = np.zeros((nodes - 1, nodes, dim))
    for i in range(nodes - 1):
        rows[i, i + 1] = x[i + 1] - x[i]
        rows[i, i] = x[i] - x[i + 1]
    return rows.reshape(nodes - 1, nodes * dim)
