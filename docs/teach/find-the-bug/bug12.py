"""Velocity Verlet for a game.

ropeode check bug12.py --order 2
"""


def step(acceleration, t, x, v, dt, args):
    """Positions and velocities dt later."""
    dt = min(dt, 1 / 60)  # no jump after a pause
    a = acceleration(t, x, v, args)
    x_new = x + dt * v + dt**2 / 2 * a
    a_new = acceleration(t + dt, x_new, v + dt * a, args)
    v_new = v + dt / 2 * (a + a_new)
    return x_new, v_new
