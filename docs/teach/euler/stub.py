"""Assignment 1: semi-implicit Euler for a rope of masses and springs.

Check it with: ropeode check stub.py --order 1 --symplectic
"""

import numpy as np


def forces(x, v, args):
    """The force on each node, an array (nodes, dim) like positions and velocities."""
    force = args.mass[:, None] * args.gravity.ravel()
    for s in range(len(x) - 1):
        # Task 1: spring s joins the nodes s and s + 1. It has the stiffness args.stiffness[s] and
        # the rest length args.rest_length[s], and pulls at both of its ends.
        raise NotImplementedError("task 1: the forces of the springs")
    # Task 2: damping is the force -args.damping[i] * v[i] on node i.
    return force


def step(acceleration, t, x, v, dt, args):
    """Positions and velocities dt later."""
    a = args.free[:, None] * forces(x, v, args) / args.mass[:, None]
    # Task 3: this is explicit Euler. What has to change?
    x_new = x + dt * v
    v_new = v + dt * a
    return x_new, v_new
