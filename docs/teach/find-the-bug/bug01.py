"""Semi-implicit Euler, with forces of its own.

ropeode check bug01.py --order 1
"""

import numpy as np


def forces(x, v, args):
    """Gravity, springs and damping."""
    force = args.mass[:, None] * args.gravity.ravel()
    for s in range(len(x) - 1):
        d = x[s + 1] - x[s]
        length = np.sqrt(d @ d)
        if length > 0:
            pull = args.stiffness[s] * (length - args.rest_length[s]) * d / length
            force[s] += pull
            force[s + 1] += pull
    return force - args.damping[:, None] * v


def step(acceleration, t, x, v, dt, args):
    """Positions and velocities dt later."""
    a = args.free[:, None] * forces(x, v, args) / args.mass[:, None]
    v = v + dt * a
    return x + dt * v, v
