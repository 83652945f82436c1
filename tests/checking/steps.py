"""Step functions as users write them, right ones and wrong ones."""

from __future__ import annotations

import numpy as np

from tests.checking.mutants.originals import own_euler as own_forces  # noqa: F401
from tests.checking.mutants.originals import rk4, velocity_verlet  # noqa: F401

COUNT = 0
BEFORE = None


def euler(rhs, t, y, dt, args):
    """Right, of order 1."""
    return y + dt * rhs(t, y, args)


def in_loops(acceleration, t, x, v, dt, args):
    """Right, of order 1, node by node."""
    x, v, a = np.array(x), np.array(v), acceleration(t, x, v, args)
    for node in range(len(x)):
        v[node] += dt * a[node]
        x[node] += dt * v[node]
    return x, v


def _pulls(length, args):
    inverse = np.divide(1.0, length, out=np.zeros_like(length), where=length > 0)
    return args.stiffness * (1.0 - args.rest_length * inverse)


def forces(x, v, args, pulls=_pulls):
    """Forces in NumPy, of springs and gravity and damping.

    Arguments:
        x: positions.
        v: velocities.
        args: of the rope.
        pulls: of each spring, over the vector along it; by its length.
    """
    d = np.diff(x, axis=0)
    pull = pulls(np.sqrt(np.sum(d * d, axis=1)), args)[:, None] * d
    force = args.mass[:, None] * args.gravity - args.damping[:, None] * v
    force[:-1] += pull
    force[1:] -= pull
    return force


def accelerations(x, v, args, *pulls):
    return args.free[:, None] * forces(x, v, args, *pulls) / args.mass[:, None]


# What follows is wrong.


def remembers(acceleration, t, x, v, dt, args):
    global BEFORE
    before = x - dt * v if BEFORE is None else BEFORE
    BEFORE = x
    new = 2 * x - before + dt**2 * acceleration(t, x, v, args)
    return new, (new - x) / dt


def counts(acceleration, t, x, v, dt, args):
    global COUNT
    COUNT += 1
    v = v + dt * acceleration(t, x, v, args)
    return x + dt * v, v * 1.01 if COUNT % 100 == 0 else v


def writes_to_args(acceleration, t, x, v, dt, args):
    args.mass[0] = args.mass[0] * 1.0 + 0.5
    v = v + dt * acceleration(t, x, v, args)
    return x + dt * v, v


def handed(acceleration, t, x, v, dt, args):
    """Turned but not mirrored: the force on a node lies across its velocity and acceleration."""
    a = np.array(acceleration(t, x, v, args))
    v = v + dt * a + 1e-3 * dt * np.cross(v, a)
    return x + dt * v, v


def single(acceleration, t, x, v, dt, args):
    x, v = np.asarray(x, np.float32), np.asarray(v, np.float32)
    x, v = velocity_verlet(acceleration, t, x, v, dt, args)
    x, v = np.asarray(x, np.float32), np.asarray(v, np.float32)
    return x.astype(np.float64), v.astype(np.float64)
