"""Right steppers, as people write them; the mutants are made from their source text."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ropeode.steppers import Phase, Stepper


def explicit_euler(acceleration, t, x, v, dt, args):
    a = acceleration(t, x, v, args)
    x_new = x + dt * v
    v_new = v + dt * a
    return x_new, v_new


def semi_implicit_euler(acceleration, t, x, v, dt, args):
    a = acceleration(t, x, v, args)
    v_new = v + dt * a
    x_new = x + dt * v_new
    return x_new, v_new


def velocity_verlet(acceleration, t, x, v, dt, args):
    a = acceleration(t, x, v, args)
    x_new = x + dt * v + dt**2 / 2 * a
    v_guess = v + dt * a
    a_new = acceleration(t + dt, x_new, v_guess, args)
    v_new = v + dt / 2 * (a + a_new)
    return x_new, v_new


def leapfrog(acceleration, t, x, v, dt, args):
    rate = (args.free * args.damping / args.mass)[:, None]
    a = acceleration(t, x, 0 * v, args)
    v_half = (1 - rate * dt / 2) * v + dt / 2 * a
    x_new = x + dt * v_half
    a_new = acceleration(t + dt, x_new, 0 * v, args)
    v_new = (v_half + dt / 2 * a_new) / (1 + rate * dt / 2)
    return x_new, v_new


def position_verlet(acceleration, t, x, v, dt, args):
    rate = (args.free * args.damping / args.mass)[:, None]
    x_half = x + dt / 2 * v
    a_half = acceleration(t + dt / 2, x_half, 0 * v, args)
    v_new = ((1 - rate * dt / 2) * v + dt * a_half) / (1 + rate * dt / 2)
    x_new = x_half + dt / 2 * v_new
    return x_new, v_new


class Positions(NamedTuple):
    now: np.ndarray
    before: np.ndarray


class StormerVerlet(Stepper):
    """The position form with a start and a damping that keep its order."""

    name = "my-verlet"
    needs = "second order, linear damping"
    symplectic = True
    source = "Verlet, Phys. Rev. 159 (1967), (4)"
    equal_frames = True

    def order(self, problem_class):
        return 2

    def init(self, system, t, y, dt):
        a = system.acceleration(t, y.x, y.v)
        return Positions(y.x, y.x - dt * y.v + dt**2 / 2 * a)

    def step(self, system, t, carried, dt):
        now, before = carried
        a = system.undamped_acceleration(t, now)
        half = system.damping.rate * dt / 2
        after = (2 * now - (1 - half) * before + dt**2 * a) / (1 + half)
        return Positions(after, now)

    def state(self, system, t, carried, dt):
        after = self.step(system, t, carried, dt).now
        v = (after - carried.before) / (2 * dt)
        return Phase(carried.now, v)


def heun(rhs, t, y, dt, args):
    k1 = rhs(t, y, args)
    k2 = rhs(t + dt, y + dt * k1, args)
    return y + dt / 2 * (k1 + k2)


def midpoint(rhs, t, y, dt, args):
    k1 = rhs(t, y, args)
    k2 = rhs(t + dt / 2, y + dt / 2 * k1, args)
    return y + dt * k2


def rk4(rhs, t, y, dt, args):
    k1 = rhs(t, y, args)
    k2 = rhs(t + dt / 2, y + dt / 2 * k1, args)
    k3 = rhs(t + dt / 2, y + dt / 2 * k2, args)
    k4 = rhs(t + dt, y + dt * k3, args)
    return y + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def rk4_coefficients(rhs, t, y, dt, args):
    k1 = rhs(t + 0.0 * dt, y, args)
    k2 = rhs(t + 0.5 * dt, y + dt * (0.5 * k1), args)
    k3 = rhs(t + 0.5 * dt, y + dt * (0.0 * k1 + 0.5 * k2), args)
    k4 = rhs(t + 1.0 * dt, y + dt * (0.0 * k1 + 0.0 * k2 + 1.0 * k3), args)
    return y + dt / 6.0 * (1.0 * k1 + 2.0 * k2 + 2.0 * k3 + 1.0 * k4)


def rk4_apart(acceleration, t, x, v, dt, args):
    v1, a1 = v, acceleration(t, x, v, args)
    x2, v2 = x + dt / 2 * v1, v + dt / 2 * a1
    a2 = acceleration(t + dt / 2, x2, v2, args)
    x3, v3 = x + dt / 2 * v2, v + dt / 2 * a2
    a3 = acceleration(t + dt / 2, x3, v3, args)
    x4, v4 = x + dt * v3, v + dt * a3
    a4 = acceleration(t + dt, x4, v4, args)
    x_new = x + dt / 6 * (v1 + 2 * v2 + 2 * v3 + v4)
    v_new = v + dt / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    return x_new, v_new


def own_forces(x, v, args):
    nodes = len(x)
    force = np.zeros_like(x)
    for i in range(nodes):
        force[i] += args.mass[i] * args.gravity
        force[i] -= args.damping[i] * v[i]
    for s in range(nodes - 1):
        d = x[s + 1] - x[s]
        length = np.sqrt(d @ d)
        if length == 0:
            continue
        pull = args.stiffness[s] * (length - args.rest_length[s]) * d / length
        force[s] += pull
        force[s + 1] -= pull
    for i in range(nodes):
        force[i] *= args.free[i] / args.mass[i]
    return force


def own_euler(acceleration, t, x, v, dt, args):
    v_new = v + dt * own_forces(x, v, args)
    return x + dt * v_new, v_new


def own_verlet(acceleration, t, x, v, dt, args):
    a = own_forces(x, v, args)
    x_new = x + dt * v + dt**2 / 2 * a
    a_new = own_forces(x_new, v + dt * a, args)
    return x_new, v + dt / 2 * (a + a_new)


def trajectory(problem, dt):
    args, t = problem.args, problem.ts[0]
    x, v = np.array(problem.y0)
    samples = [(t, x, v)]
    for end in problem.ts[1:]:
        steps = int((end - t) / dt + 1e-9)
        for _ in range(steps):
            x, v = own_verlet(None, t, x, v, dt, args)
        left = end - t - steps * dt
        if left > 1e-12:
            x, v = own_verlet(None, t, x, v, left, args)
        t = end
        samples.append((t, x, v))
    return samples


_STRUCTURE = {"symplectic": True, "reversible": True, "conserves_energy": True}

# Family of each, and what its author claims.
ORIGINALS = {
    explicit_euler: ("explicit Euler", {"expected_order": 1}),
    semi_implicit_euler: (
        "semi-implicit Euler",
        {"expected_order": 1, "symplectic": True, "conserves_energy": True},
    ),
    velocity_verlet: ("velocity Verlet", {"expected_order": 2, **_STRUCTURE}),
    leapfrog: ("velocity Verlet", {"expected_order": 2, **_STRUCTURE}),
    position_verlet: ("position Verlet", {"expected_order": 2, **_STRUCTURE}),
    StormerVerlet: ("position Verlet", {"expected_order": 2, "conserves_energy": True}),
    heun: ("Heun and midpoint", {"expected_order": 2}),
    midpoint: ("Heun and midpoint", {"expected_order": 2}),
    rk4: ("RK4", {"expected_order": 4}),
    rk4_coefficients: ("RK4", {"expected_order": 4}),
    rk4_apart: ("RK4", {"expected_order": 4}),
    own_euler: (
        "own forces",
        {"expected_order": 1, "symplectic": True, "conserves_energy": True},
    ),
    own_verlet: ("own forces", {"expected_order": 2, **_STRUCTURE}),
    trajectory: ("trajectory loop", {"expected_order": 2}),
}
