"""Semi-implicit Euler, with the damping as a factor.

ropeode check bug07.py --order 1
"""


def step(acceleration, t, x, v, dt, args):
    """Positions and velocities dt later."""
    undamped = args._replace(damping=0 * args.damping)
    v_new = (1 - args.damping)[:, None] * v + dt * acceleration(t, x, v, undamped)
    x_new = x + dt * v_new
    return x_new, v_new
