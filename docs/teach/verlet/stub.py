"""Assignment 2: Verlet of order 2, with damping that belongs to time.

Check it with: ropeode check stub.py --order 2 --symplectic --reversible
"""


def step(acceleration, t, x, v, dt, args):
    """Positions and velocities dt later; acceleration(t, x, v, args) includes the damping."""
    # The Verlet of the well-known assignment. x - dt * v stands for the last position.
    undamped = acceleration(t, x, v, args._replace(damping=0 * args.damping))
    damping_factor = 0.00005
    x_new = x + (1 - damping_factor) * dt * v + dt**2 * undamped
    v_new = (x_new - x) / dt
    return x_new, v_new
