"""A step function for any right-hand side: Heun's method, of order 2."""


def heun(rhs, t, y, dt, args):
    """The state at t + dt; y is an array, for a rope of shape (2, nodes, dim)."""
    k1 = rhs(t, y, args)
    k2 = rhs(t + dt, y + dt * k1, args)
    return y + dt / 2 * (k1 + k2)
