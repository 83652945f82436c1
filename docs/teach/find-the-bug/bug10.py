"""The Runge-Kutta method of order 4.

ropeode check bug10.py --order 4
"""


def step(rhs, t, y, dt, args):
    """The state dt later."""
    k1 = rhs(t, y, args)
    k2 = rhs(t + dt / 2, y + dt / 2 * k1, args)
    k3 = rhs(t + dt / 2, y + dt / 2 * k1, args)
    k4 = rhs(t + dt, y + dt * k3, args)
    return y + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
