"""Assignment 1: semi-implicit Euler for a rope of masses and springs.

Check it with: ropeode check solution.py --order 1 --symplectic
"""

import numpy as np


def forces(x, v, args):
    """The force on each node, an array (nodes, dim) like positions and velocities."""
    force = args.mass[:, None] * args.gravity.ravel()
    for s in range(len(x) - 1):
        d = x[s + 1] - x[s]
        length = np.linalg.norm(d)
        if length > 0:
            pull = args.stiffness[s] * (length - args.rest_length[s]) * d / length
            force[s] += pull
            force[s + 1] -= pull
    return force - args.damping[:, None] * v


def step(acceleration, t, x, v, dt, args):
    """Positions and velocities dt later."""
    a = args.free[:, None] * forces(x, v, args) / args.mass[:, None]
    v_new = v + dt * a
    x_new = x + dt * v_new
    return x_new, v_new
