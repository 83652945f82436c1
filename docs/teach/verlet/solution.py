"""Assignment 2: Verlet of order 2, with damping that belongs to time.

Check it with: ropeode check solution.py --order 2 --symplectic --reversible
"""


def step(acceleration, t, x, v, dt, args):
    """Positions and velocities dt later; acceleration(t, x, v, args) includes the damping."""
    a = acceleration(t, x, v, args)
    x_new = x + dt * v + dt**2 / 2 * a
    a_new = acceleration(t + dt, x_new, v + dt * a, args)
    v_new = v + dt / 2 * (a + a_new)
    return x_new, v_new
