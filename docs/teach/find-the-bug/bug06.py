"""Velocity Verlet.

ropeode check bug06.py --order 2
"""


def step(acceleration, t, x, v, dt, args):
    """Positions and velocities dt later."""
    a = acceleration(t, x, v, args)
    x_new = x + dt * v + dt**2 / 2 * a
    a_new = acceleration(t + dt, x_new, v, args)
    v_new = v + dt / 2 * (a + a_new)
    return x_new, v_new
