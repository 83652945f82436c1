"""Semi-implicit Euler, with forces of its own and one array for all of them.

ropeode check bug04.py --order 1
"""

import numpy as np

forces = np.zeros((100, 3))


def step(acceleration, t, x, v, dt, args):
    """Positions and velocities dt later."""
    nodes, dim = x.shape
    force = forces[:nodes, :dim]
    for i in range(nodes):
        force[i] += args.mass[i] * args.gravity.ravel() - args.damping[i] * v[i]
    for s in range(nodes - 1):
        d = x[s + 1] - x[s]
        length = np.sqrt(d @ d)
        if length > 0:
            pull = args.stiffness[s] * (length - args.rest_length[s]) * d / length
            force[s] += pull
            force[s + 1] -= pull
    v = v + dt * args.free[:, None] * force / args.mass[:, None]
    return x + dt * v, v
