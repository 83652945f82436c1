"""The stepper of steps.py with a common mistake: ropeode check lagged.py:velocity_verlet --order 2.

The force at the end of the step is computed with the velocity at its beginning.
"""


def velocity_verlet(acceleration, t, x, v, dt, args):
    """Positions and velocities are arrays (nodes, dim), in NumPy or JAX."""
    a = acceleration(t, x, v, args)
    x_new = x + dt * v + dt**2 / 2 * a
    a_new = acceleration(t + dt, x_new, v, args)
    return x_new, v + dt / 2 * (a + a_new)
