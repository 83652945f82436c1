"""Step functions of users beside the same formulas built in: time per step, as ratios.

python benchmarks/users_steppers.py
"""

from __future__ import annotations

import numpy as np

from ropeode import Rope, simulate

RUNS, STEPS = 15, 4000


def semi_implicit(acceleration, t, x, v, dt, args):
    """Semi-implicit Euler."""
    v = v + dt * acceleration(t, x, v, args)
    return x + dt * v, v


def explicit(rhs, t, y, dt, args):
    """Explicit Euler."""
    return y + dt * rhs(t, y, args)


def rk4(rhs, t, y, dt, args):
    """The classical method."""
    k1 = rhs(t, y, args)
    k2 = rhs(t + dt / 2, y + dt / 2 * k1, args)
    k3 = rhs(t + dt / 2, y + dt / 2 * k2, args)
    k4 = rhs(t + dt, y + dt * k3, args)
    return y + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


PAIRS = {"semi-implicit-euler": semi_implicit, "explicit-euler": explicit, "rk4": rk4}


def main() -> None:
    """Print the table."""
    print(f"{'':20}  nodes  built in, ns  function, ns  ratio")
    for nodes in (16, 64, 256):
        problem = Rope(num_nodes=nodes, damping=0.1).problem(frames=20)
        for name, function in PAIRS.items():
            seconds = np.empty((RUNS, 2))
            for run in range(-1, RUNS):
                # The first pair compiles. Side by side, so that both see the same machine.
                seconds[run] = [simulate(problem, each, STEPS).seconds for each in (name, function)]
            ratio = np.median(seconds[:, 1] / seconds[:, 0])
            own, users = np.median(seconds, axis=0) / (STEPS * problem.frames) * 1e9
            print(f"{name:20}  {nodes:5}  {own:12.0f}  {users:12.0f}  {ratio:5.2f}")


if __name__ == "__main__":
    main()
