"""Heun's method.

ropeode check bug09.py --order 2
"""


def step(rhs, t, y, dt, args):
    """The state dt later."""
    k1 = rhs(t, y, args)
    k2 = rhs(t, y + dt * k1, args)
    return y + dt / 2 * (k1 + k2)
