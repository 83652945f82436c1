"""Velocity Verlet.

ropeode check bug03.py --order 2
"""


def step(acceleration, t, x, v, dt, args):
    """Positions and velocities dt later."""
    a = acceleration(t, x, v, args)
    x += dt * v + dt**2 / 2 * a
    a_new = acceleration(t + dt, x, v + dt * a, args)
    v += dt / 2 * (a + a_new)
    return x, v
