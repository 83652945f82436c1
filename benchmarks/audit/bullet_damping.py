"""Which damping a multi-body of Bullet has: runs of the exporter against laws of damping.

    .venv/bin/python benchmarks/audit/bullet_damping.py .venv-audit/pybullet/bin/python

Each law is solved by SciPy's DOP853 with forces written again in NumPy. Prints the largest
distance of positions for 200, 400 and 800 steps per frame: it halves for the law that is solved.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np
from judge import exported, job_of
from scipy.integrate import solve_ivp

STEPS = (200, 400, 800)
RATE = 0.8
LAWS = {
    "-d v": lambda v: RATE * v,
    "-d |v| v": lambda v: RATE * _speed(v) * v,
    "-d (1 + |v|) v": lambda v: RATE * (1.0 + _speed(v)) * v,
}


def _speed(v):
    return np.linalg.norm(v, axis=1, keepdims=True)


def _solution(table, law):
    length = np.hypot(*(table[1, 2:4] - table[0, 2:4]))

    def slope(_, y):
        x, v = y.reshape(2, -1, 2)
        along = np.diff(x, axis=0)
        stretch = 1.0 - length / np.linalg.norm(along, axis=1, keepdims=True)
        force = np.diff(np.pad(200.0 * stretch * along, ((1, 1), (0, 0))), axis=0)
        a = force / 0.5 + np.array([0.0, -9.81]) - law(v)
        a[0] = 0.0
        return np.concatenate([v.ravel(), a.ravel()])

    start = np.concatenate([table[:, 2:4].ravel(), table[:, 4:6].ravel()])
    found = solve_ivp(
        slope, (0.0, 2.0), start, method="DOP853", rtol=1e-11, atol=1e-11, t_eval=[0.0, 1.0, 2.0]
    )
    return found.y.T.reshape(3, 2, -1, 2)[:, 0]


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder) / "runs"
        job = job_of("springs-damped")
        exported(Path(sys.argv[1]), "bullet_rope.py", "multi", job, STEPS, place)
        table = np.loadtxt(place / "initial.csv", delimiter=",", skiprows=1)
        runs = [
            np.loadtxt(place / f"rope-{n}.csv", delimiter=",", skiprows=1).reshape(3, -1, 6)
            for n in STEPS
        ]
    for name, law in LAWS.items():
        truth = _solution(table, law)
        print(f"{name:16}", *(f"{np.max(np.abs(run[:, :, 2:4] - truth)):.4f}" for run in runs))
