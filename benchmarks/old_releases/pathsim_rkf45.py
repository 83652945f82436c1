"""pathsim's Runge-Kutta-Fehlberg method, one step at a time."""

from __future__ import annotations

from pathsim.solvers import RKF45
from rope import runs_of


def step(slope, t, y, dt):
    """One step."""
    solver = RKF45(y)
    solver.integrate_singlestep(lambda y, time: slope(time, y), t, dt)
    return solver.get()


if __name__ == "__main__":
    runs_of(step)
