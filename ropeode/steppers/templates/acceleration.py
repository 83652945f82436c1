"""A step function for positions and velocities: velocity Verlet, of order 2."""


def velocity_verlet(acceleration, t, x, v, dt, args):
    """The state at t + dt; x and v are arrays (nodes, dim), in NumPy or JAX."""
    a = acceleration(t, x, v, args)
    x_new = x + dt * v + dt**2 / 2 * a
    a_new = acceleration(t + dt, x_new, v + dt * a, args)
    return x_new, v + dt / 2 * (a + a_new)
