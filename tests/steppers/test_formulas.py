"""Each stepper against its formula, written out again in plain NumPy."""

from __future__ import annotations

import numpy as np
import pytest

from ropeode.problems.rope import Rope
from ropeode.simulation import simulate
from tests.steppers.every_variant import EVERY_PARAMETER

ROPE = Rope(
    start=(0.0, 0.0, 1.0),
    end=(3.0, -1.0, 0.5),
    num_nodes=5,
    node_mass=(1.0, 2.0, 0.5, 1.5, 0.7),
    stiffness=(30.0, 20.0, 45.0, 10.0),
    pinned=(1,),
    gravity=(0.3, -1.0, 0.2),
    damping=(0.1, 0.2, 0.3, 0.4, 0.5),
    initial_velocity=((0.1, 0.2, 0.3), (0, 0, 0), (1, -1, 0), (0.5, 0, 0.2), (0, 0.7, -0.4)),
)
PROBLEM = ROPE.problem(frames=3)
STEPS = 7
DT = 1.0 / STEPS


def acceleration(x, v):
    """Forces node by node; `x` and `v` are (nodes, dim)."""
    start = PROBLEM.positions(PROBLEM.y0[None])[0]
    force = np.array([m * np.array(ROPE.gravity) for m in ROPE.node_mass])
    force -= np.array(ROPE.damping)[:, None] * v
    for i, k in enumerate(ROPE.stiffness):
        rest = np.linalg.norm(start[i + 1] - start[i])
        length = np.linalg.norm(x[i + 1] - x[i])
        pull = k * (length - rest) * (x[i + 1] - x[i]) / length
        force[i] += pull
        force[i + 1] -= pull
    force[list(ROPE.pinned)] = 0.0
    return force / np.array(ROPE.node_mass)[:, None]


FREE = np.array([0.0 if i in ROPE.pinned else 1.0 for i in range(5)])[:, None]
RATE = np.array(ROPE.damping)[:, None] / np.array(ROPE.node_mass)[:, None] * FREE
COEFFICIENT = np.array(ROPE.damping)[:, None] * FREE


def undamped(x):
    return acceleration(x, np.zeros_like(x))


def explicit_euler(x, v, steps):
    for _ in range(steps):
        x, v = x + DT * v, v + DT * acceleration(x, v)
    return x, v


def semi_implicit_euler(x, v, steps):
    for _ in range(steps):
        v = v + DT * acceleration(x, v)
        x = x + DT * v
    return x, v


def velocity_verlet(x, v, steps):
    for _ in range(steps):
        middle = v + DT / 2 * (undamped(x) - RATE * v)
        x = x + DT * middle
        v = (middle + DT / 2 * undamped(x)) / (1 + RATE * DT / 2)
    return x, v


def rk4(x, v, steps):
    for _ in range(steps):
        a1 = acceleration(x, v)
        x2, v2 = x + DT / 2 * v, v + DT / 2 * a1
        a2 = acceleration(x2, v2)
        x3, v3 = x + DT / 2 * v2, v + DT / 2 * a2
        a3 = acceleration(x3, v3)
        x4, v4 = x + DT * v3, v + DT * a3
        a4 = acceleration(x4, v4)
        x = x + DT / 6 * (v + 2 * v2 + 2 * v3 + v4)
        v = v + DT / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    return x, v


def stormer_verlet(start, damping):
    def step(x, before):
        """The next positions, from the implicit equation with the damping that is meant."""
        a = undamped(x)
        if damping == "lagged":
            return 2 * x - before + DT**2 * (a - RATE * (x - before) / DT)
        if damping == "per-step":
            return x + (1 - COEFFICIENT) * (x - before) + DT**2 * a
        after = x
        for _ in range(60):
            after = 2 * x - before + DT**2 * (a - RATE * (after - before) / (2 * DT))
        return after

    def run(x, v, steps):
        before = x - DT * v + DT**2 / 2 * acceleration(x, v) if start == "taylor" else x
        for _ in range(steps):
            x, before = step(x, before), x
        return x, (step(x, before) - before) / (2 * DT)

    return run


START = PROBLEM.positions(PROBLEM.y0[None])[0]
GRAVITY = FREE * np.array(ROPE.gravity)
INVERSE_MASS = FREE / np.array(ROPE.node_mass)[:, None]


def stretching(x):
    """What gives ``d . (b - a)`` of each link from node vectors, ``(links, nodes * dim)``."""
    nodes, dim = x.shape
    rows = np.zeros((nodes - 1, nodes, dim))
    for i in range(nodes - 1):
        rows[i, i + 1] = x[i + 1] - x[i]
        rows[i, i] = x[i] - x[i + 1]
    return rows.reshape(nodes - 1, -1)


def squares(x):
    return np.sum(np.diff(x, axis=0) ** 2, axis=1)


def pulls(x, needed, inverse_mass, along=None):
    """The smallest change of node vectors, by pulls along the links, that stretches as needed."""
    rows = stretching(x)
    weighted = np.broadcast_to(inverse_mass, x.shape).ravel()[:, None] * rows.T
    across = rows if along is None else stretching(along)
    return (weighted @ np.linalg.solve(across @ weighted, needed)).reshape(x.shape)


def rigid_acceleration(x, v):
    applied = GRAVITY - RATE * v
    needed = -squares(v) - stretching(x) @ applied.ravel()
    return applied + pulls(x, needed, INVERSE_MASS)


def swept(x, sweeps):
    x = x.copy()
    for _ in range(sweeps):
        for i in range(len(x) - 1):
            a, b = INVERSE_MASS[i, 0], INVERSE_MASS[i + 1, 0]
            length = np.linalg.norm(START[i + 1] - START[i])
            gap = x[i + 1] - x[i]
            excess = gap - length * gap / np.linalg.norm(gap)
            x[i] += a / (a + b) * excess
            x[i + 1] -= b / (a + b) * excess
    return x


def constraint_verlet(sweeps, start, damping):
    def step(x, before):
        """Where the swept positions go next."""
        if damping == "lagged":
            return 2 * x - before + DT**2 * (GRAVITY - RATE * (x - before) / DT)
        if damping == "per-step":
            return x + (1 - COEFFICIENT) * (x - before) + DT**2 * GRAVITY
        after = x
        for _ in range(60):
            after = 2 * x - before + DT**2 * (GRAVITY - RATE * (after - before) / (2 * DT))
        return after

    def run(x, v, steps):
        taylor = x - DT * v + DT**2 / 2 * rigid_acceleration(x, v)
        every_swept, every = [taylor if start == "taylor" else x], [x]
        for _ in range(steps + 1):
            every_swept.append(swept(every[-1], sweeps))
            every.append(step(every_swept[-1], every_swept[-2]))
        every_swept.append(swept(every[-1], sweeps))
        return every[steps], (every_swept[steps + 2] - every_swept[steps]) / (2 * DT)

    return run


def rattle(x, v, steps):
    for _ in range(steps):
        middle = v + DT / 2 * (GRAVITY - RATE * v)
        for _ in range(60):
            ahead = x + DT * middle
            wrong = squares(START) - squares(ahead)
            middle = middle + pulls(x, wrong / (2 * DT), INVERSE_MASS, along=ahead)
        x = x + DT * middle
        v = (middle + DT / 2 * GRAVITY) / (1 + RATE * DT / 2)
        # The pulls act on the new velocity, which its own damping already brakes.
        v = v + pulls(x, -stretching(x) @ v.ravel(), INVERSE_MASS / (1 + RATE * DT / 2))
    return x, v


FORMULAS = {
    "explicit-euler": explicit_euler,
    "semi-implicit-euler": semi_implicit_euler,
    "velocity-verlet": velocity_verlet,
    "rk4": rk4,
    "rattle": rattle,
}


@pytest.mark.parametrize("stepper", EVERY_PARAMETER)
def test_stepper_is_its_formula(stepper):
    if stepper.name == "stormer-verlet":
        formula = stormer_verlet(stepper.start, stepper.damping)
    elif stepper.name == "constraint-verlet":
        formula = constraint_verlet(stepper.sweeps, stepper.start, stepper.damping)
    else:
        formula = FORMULAS[stepper.name]
    run = simulate(PROBLEM, stepper, STEPS)
    x, v = run.positions[0], run.velocities[0]
    for frame in range(1, 4):
        expected_x, expected_v = formula(x, v, frame * STEPS)
        np.testing.assert_allclose(run.positions[frame], expected_x, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(run.velocities[frame], expected_v, rtol=1e-12, atol=1e-12)
