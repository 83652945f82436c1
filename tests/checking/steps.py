"""Step functions as users write them, right ones and wrong ones."""

from __future__ import annotations

import numpy as np

COUNT = 0
BEFORE = None


def velocity_verlet(acceleration, t, x, v, dt, args):
    """Right, of order 2; for damping it takes the new velocity from an explicit step."""
    a = acceleration(t, x, v, args)
    x_new = x + dt * v + dt**2 / 2 * a
    v_guess = v + dt * a
    a_new = acceleration(t + dt, x_new, v_guess, args)
    return x_new, v + dt / 2 * (a + a_new)


def leapfrog(acceleration, t, x, v, dt, args):
    """Right without damping, where it is symplectic and reversible."""
    v_half = v + dt / 2 * acceleration(t, x, v, args)
    x_new = x + dt * v_half
    return x_new, v_half + dt / 2 * acceleration(t + dt, x_new, v_half, args)


def euler(rhs, t, y, dt, args):
    """Right, of order 1."""
    return y + dt * rhs(t, y, args)


def rk4(rhs, t, y, dt, args):
    """Right, of order 4."""
    k1 = rhs(t, y, args)
    k2 = rhs(t + dt / 2, y + dt / 2 * k1, args)
    k3 = rhs(t + dt / 2, y + dt / 2 * k2, args)
    k4 = rhs(t + dt, y + dt * k3, args)
    return y + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def forces(x, v, args):
    """The accelerations of a rope, spring by spring, in plain NumPy."""
    force = args.mass[:, None] * args.gravity - args.damping[:, None] * v
    for i in range(len(x) - 1):
        d = x[i + 1] - x[i]
        length = np.sqrt(d @ d)
        if length > 0:
            pull = args.stiffness[i] * (length - args.rest_length[i]) * d / length
            force[i] += pull
            force[i + 1] -= pull
    return force / args.mass[:, None] * args.free[:, None]


def own_forces(acceleration, t, x, v, dt, args):
    """Right, of order 1, in loops, and without asking for the acceleration."""
    v = v + dt * forces(x, v, args)
    return x + dt * v, v


def in_loops(acceleration, t, x, v, dt, args):
    """Right, of order 1, node by node."""
    x, v, a = np.array(x), np.array(v), acceleration(t, x, v, args)
    for node in range(len(x)):
        v[node] += dt * a[node]
        x[node] += dt * v[node]
    return x, v


# What follows is wrong, each in a way that one check is there for.


def draws(acceleration, t, x, v, dt, args):
    v = v + dt * acceleration(t, x, v, args)
    return x + dt * v + 1e-9 * np.random.default_rng().normal(), v


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


def writes(acceleration, t, x, v, dt, args):
    v += dt * acceleration(t, x, v, args)
    x += dt * v
    return x, v


def writes_to_args(acceleration, t, x, v, dt, args):
    args.mass[0] = args.mass[0] * 1.0 + 0.5
    v = v + dt * acceleration(t, x, v, args)
    return x + dt * v, v


def without_damping(acceleration, t, x, v, dt, args):
    return velocity_verlet(acceleration, t, x, v, dt, args._replace(damping=0.0 * args.damping))


def at_its_own_time(acceleration, t, x, v, dt, args):
    return velocity_verlet(acceleration, 0.0, x, v, dt, args)


def moves_pins(acceleration, t, x, v, dt, args):
    v = v + dt * (acceleration(t, x, v, args) + 1e-3 * args.gravity)
    return x + dt * v, v


def pulls_at_one_end(acceleration, t, x, v, dt, args):
    force = np.zeros_like(x)
    for i in range(len(x) - 1):
        d = x[i + 1] - x[i]
        length = np.sqrt(d @ d)
        force[i] += args.stiffness[i] * (length - args.rest_length[i]) * d / length
    v = v + dt * (force / args.mass[:, None] + args.gravity) * args.free[:, None]
    return x + dt * v, v


def at_most_a_sixtieth(acceleration, t, x, v, dt, args):
    dt = np.minimum(dt, 1.0 / 60.0)
    v = v + dt * acceleration(t, x, v, args)
    return x + dt * v, v


def whole_lengths(acceleration, t, x, v, dt, args):
    whole = args._replace(rest_length=np.floor(args.rest_length))
    v = v + dt * forces(x, v, whole)
    return x + dt * v, v


def falls_asleep(acceleration, t, x, v, dt, args):
    v = v + dt * acceleration(t, x, v, args)
    return x + dt * v, v * (abs(v) > 1e-4)


def five_nodes(acceleration, t, x, v, dt, args):
    five = (np.arange(len(x)) < 5)[:, None]
    v = v + five * dt * acceleration(t, x, v, args)
    return x + dt * v, v


def breaks(acceleration, t, x, v, dt, args):
    d = x[1:] - x[:-1]
    whole = (d**2).sum(1) < 25.0 * args.rest_length**2
    v = v + dt * forces(x, v, args._replace(stiffness=args.stiffness * whole))
    return x + dt * v, v


def drag_by_place(acceleration, t, x, v, dt, args):
    v = v + dt * (acceleration(t, x, v, args) - 1e-4 * x * args.free[:, None])
    return x + dt * v, v


def speed_limit(acceleration, t, x, v, dt, args):
    v = np.clip(v + dt * acceleration(t, x, v, args), -100.0, 100.0)
    return x + dt * v, v


def only_two_components(acceleration, t, x, v, dt, args):
    a = np.array(acceleration(t, x, v, args))
    a[:, 2] = 0.0
    v = v + dt * a
    return x + dt * v, v


def turns_left(acceleration, t, x, v, dt, args):
    axis = np.array([0.0, 0.0, 1.0])
    v = v + dt * acceleration(t, x, v, args) + 1e-3 * dt * np.cross(axis, v)
    return x + dt * v, v


def handed(acceleration, t, x, v, dt, args):
    """Turned but not mirrored: the force on a node lies across its velocity and acceleration."""
    a = np.array(acceleration(t, x, v, args))
    v = v + dt * a + 1e-3 * dt * np.cross(v, a)
    return x + dt * v, v


def in_place(acceleration, t, x, v, dt, args):
    x, v = np.array(x), np.array(v)
    for node in range(len(x)):
        v[node] += dt * np.array(acceleration(t, x, v, args))[node]
        x[node] += dt * v[node]
    return x, v


def begins_softly(acceleration, t, x, v, dt, args):
    v = v + dt * np.minimum(1.0, 1.0 + t / 100.0) * acceleration(t, x, v, args)
    v = v * (1.0 + 1e-4 * dt * t)
    return x + dt * v, v


def single(acceleration, t, x, v, dt, args):
    x, v = np.asarray(x, np.float32), np.asarray(v, np.float32)
    x, v = velocity_verlet(acceleration, t, x, v, dt, args)
    x, v = np.asarray(x, np.float32), np.asarray(v, np.float32)
    return x.astype(np.float64), v.astype(np.float64)


def divides_by_length(acceleration, t, x, v, dt, args):
    force = args.mass[:, None] * args.gravity - args.damping[:, None] * v
    for i in range(len(x) - 1):
        d = x[i + 1] - x[i]
        length = np.sqrt(d @ d)
        pull = args.stiffness[i] * (length - args.rest_length[i]) * d / length
        force[i] += pull
        force[i + 1] -= pull
    v = v + dt * force / args.mass[:, None] * args.free[:, None]
    return x + dt * v, v
