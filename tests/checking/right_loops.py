"""Right steppers as people write them: loops, solvers by iteration, forces of their own.

Nobody who wrote one of these looked at the checks. Each comes with what is true of it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from scipy import integrate, linalg, sparse

from ropeode.steppers import Phase, Stepper
from tests.checking.steps import accelerations, forces


def stiffness_matrix(x, args, definite=False):
    """The derivative of the springs' forces, ``(3 nodes, 3 nodes)``, block by block.

    Semi-definite without what a compressed spring has across its direction.
    """
    n, dim = x.shape
    out = np.zeros((n, dim, n, dim))
    for s, (k, rest) in enumerate(zip(args.stiffness, args.rest_length, strict=True)):
        d = x[s + 1] - x[s]
        length = math.sqrt(d @ d)
        if length == 0.0:
            continue
        u = d / length
        across = max(1.0 - rest / length, 0.0) if definite else 1.0 - rest / length
        block = k * (np.outer(u, u) + across * (np.eye(dim) - np.outer(u, u)))
        out[s, :, s] -= block
        out[s + 1, :, s + 1] -= block
        out[s, :, s + 1] += block
        out[s + 1, :, s] += block
    return out.reshape(n * dim, n * dim)


# --- Explicit methods with forces of their own -------------------------------------------------


def overflowing(acceleration, t, x, v, dt, args):
    """Explicit Euler; squares of Python's floats overflow with an exception where it blows up."""
    lengths = [sum(c**2 for c in d) ** 0.5 for d in np.diff(x, axis=0).tolist()]
    inverse = np.array([1.0 / length if length > 0.0 else 0.0 for length in lengths])
    pulls = args.stiffness * (1.0 - args.rest_length * inverse)
    return x + dt * v, v + dt * accelerations(x, v, args, lambda *_: pulls)


def pairs_in_turn(acceleration, t, x, v, dt, args):
    """A splitting: the flow of each spring alone, by a step of Verlet, one after the other."""
    v = v + dt * args.free[:, None] * (args.gravity - (args.damping / args.mass)[:, None] * v)
    x, v = x + dt * v, v.copy()
    for s in range(len(x) - 1):
        d = x[s + 1] - x[s]
        length = np.sqrt(d @ d)
        if length == 0:
            continue
        pull = dt * args.stiffness[s] * (1.0 - args.rest_length[s] / length) * d
        for i, sign in ((s, 1.0), (s + 1, -1.0)):
            push = sign * args.free[i] / args.mass[i] * pull
            v[i] += push
            x[i] += 0.5 * dt * push
    return x, v


def verlet_in_place(acceleration, t, x, v, dt, args):
    """Kick, drift, kick; the second kick is implicit in the linear damping."""
    x, v = x.copy(), v.copy()
    rate = (args.free * args.damping / args.mass)[:, None]
    still = np.zeros_like(v)
    v += 0.5 * dt * (accelerations(x, still, args) - rate * v)
    x += dt * v
    v += 0.5 * dt * accelerations(x, still, args)
    v /= 1.0 + 0.5 * dt * rate
    return x, v


def damping_first(acceleration, t, x, v, dt, args):
    """Semi-implicit Euler with a factor exp(-rate dt)."""
    v = v * np.exp(-dt * args.free * args.damping / args.mass)[:, None]
    v = v + dt * accelerations(x, np.zeros_like(v), args)
    return x + dt * v, v


def sub_steps_by_stiffness(acceleration, t, x, v, dt, args):
    """As many steps as the stiffest spring needs."""
    omega = math.sqrt(4.0 * np.max(args.stiffness) / np.min(args.mass)) + 1e-30
    n = max(1, min(64, math.ceil(dt * omega)))
    for i in range(n):
        a = acceleration(t + i * dt / n, x, v, args)
        half = v + 0.5 * dt / n * a
        x = x + dt / n * half
        guess = v + dt / n * a
        v = half + 0.5 * dt / n * acceleration(t + (i + 1) * dt / n, x, guess, args)
    return x, v


def in_parts(rhs, t, y, dt, args):
    """Explicit Euler with parts of 0.02, more exact in some units than in others."""
    parts = jnp.clip(jnp.ceil(dt / 0.02), 1, 8).astype(int)
    h = dt / parts
    return jax.lax.fori_loop(0, parts, lambda i, y: y + h * rhs(t + i * h, y, args), y)


def rk4_in_long_double(rhs, t, y, dt, args):
    """Sums in extended precision, slopes in float64."""
    y80, h = np.asarray(y, dtype=np.longdouble), np.longdouble(dt)

    def f(t, y):
        return np.asarray(rhs(t, np.asarray(y, dtype=np.float64), args), dtype=np.longdouble)

    k1 = f(t, y80)
    k2 = f(t + dt / 2, y80 + h / 2 * k1)
    k3 = f(t + dt / 2, y80 + h / 2 * k2)
    k4 = f(t + dt, y80 + h * k3)
    return np.asarray(y80 + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4), dtype=np.float64)


# --- Implicit methods --------------------------------------------------------------------------


def stopped_early(rhs, t, y, dt, args):
    """Backward Euler by fixed-point iteration: each step leaves an error of up to 1e-8."""
    new = y + dt * rhs(t, y, args)
    for _ in range(100):
        before, new = new, y + dt * rhs(t + dt, new, args)
        if np.max(np.abs(np.asarray(new - before))) < 1e-8:
            break
    return new


def linearly_implicit(solve: Callable, definite: bool = False) -> Callable:
    """Baraff and Witkin 1998: one linear system, one Newton step of backward Euler."""

    def step(acceleration, t, x, v, dt, args):
        free, mass, rate = np.repeat([args.free, args.mass, args.damping], x.shape[1], axis=1)
        free = free > 0
        k = stiffness_matrix(x, args, definite)
        matrix = np.diag(mass + dt * rate) - dt**2 * k
        right = dt * (forces(x, v, args).ravel() + dt * k @ np.where(free, v.ravel(), 0.0))
        dv = np.zeros(x.size)
        dv[free] = solve(matrix[np.ix_(free, free)], right[free])
        v_new = v + dv.reshape(v.shape)
        return x + dt * v_new, v_new

    return step


def one_sweep(a, b):
    """Of Gauss and Seidel, over the unknowns."""
    return linalg.solve_triangular(a, b, lower=True)


def conjugate_gradients(a, b):
    """To 1e-6 of the right-hand side."""
    return sparse.linalg.cg(a, b, rtol=1e-6)[0]


def rosenbrock2(rhs, t, y, dt, args):
    """ROS2 with gamma = 1 + 1/sqrt(2) (Verwer and others 1999), Jacobian by JAX."""
    gamma = 1.0 + 1.0 / np.sqrt(2.0)
    y = jnp.asarray(y)
    f = lambda s, z: rhs(s, z.reshape(y.shape), args).ravel()  # noqa: E731
    flat = y.ravel()
    jacobian = jax.jacfwd(f, argnums=1)(t, flat)
    of_time = jax.jacfwd(f, argnums=0)(t, flat)
    matrix = jnp.eye(y.size) - gamma * dt * jacobian
    k1 = jnp.linalg.solve(matrix, f(t, flat) + gamma * dt * of_time)
    k2 = jnp.linalg.solve(matrix, f(t + dt, flat + dt * k1) - 2.0 * k1 - gamma * dt * of_time)
    return (flat + dt * (1.5 * k1 + 0.5 * k2)).reshape(y.shape)


# --- Position based dynamics, springs as compliant constraints ---------------------------------


def xpbd(iterations: int) -> Callable:
    """Macklin, Mueller, Chentanez 2016: compliance 1/k, Gauss-Seidel over the springs.

    Floats of Python: for them 1/0 raises.
    """

    def step(acceleration, t, x, v, dt, args):
        w = (args.free / args.mass).tolist()
        v = v + dt * args.free[:, None] * args.gravity
        v = v / (1.0 + dt * args.free / args.mass * args.damping)[:, None]
        p = x + dt * v
        alpha = [1.0 / k / float(dt) ** 2 for k in args.stiffness.tolist()]
        lam = np.zeros(len(x) - 1)
        for _ in range(iterations):
            for s in range(len(x) - 1):
                d = p[s + 1] - p[s]
                length = math.sqrt(d @ d)
                if length < 1e-12 or w[s] + w[s + 1] == 0:
                    continue
                n = d / length
                c = length - args.rest_length[s]
                change = (-c - alpha[s] * lam[s]) / (w[s] + w[s + 1] + alpha[s])
                lam[s] += change
                p[s] -= w[s] * change * n
                p[s + 1] += w[s + 1] * change * n
        return p, (p - x) / dt

    return step


# --- What guards itself, and what iterates to a tolerance --------------------------------------


def guarded(guard):
    """Own forces, guarded against springs of length zero."""

    def pulls(length, args):
        return args.stiffness * (1.0 - args.rest_length / guard(length))

    def step(acceleration, t, x, v, dt, args):
        v = v + dt * accelerations(x, v, args, pulls)
        return x + dt * v, v

    return step


def midpoint_to(tolerance, most=1000):
    """The implicit midpoint rule, up to an absolute tolerance."""

    def step(rhs, t, y, dt, args):
        y = np.array(y)
        new = y + dt * rhs(t, y, args)
        for _ in range(most):
            last, new = new, y + dt * rhs(t + dt / 2, (y + new) / 2, args)
            if np.max(np.abs(new - last)) < tolerance:
                return new
        raise RuntimeError("no convergence")

    return step


def for_three_dimensions(acceleration, t, x, v, dt, args):
    along_x, along_y, along_z = np.asarray(acceleration(t, x, v, args)).T
    v = v + dt * np.stack([along_x, along_y, along_z], axis=1)
    return x + dt * v, v


def adaptive(rhs, t, y, dt, args):
    """Heun's method with steps of its own, which keep the largest component to a tolerance."""
    end, h, y = t + dt, dt, np.asarray(y)
    while t < end - 1e-12:
        h = min(h, end - t)
        first = np.asarray(rhs(t, y, args))
        second = np.asarray(rhs(t + h, y + h * first, args))
        if np.max(np.abs(h * (second - first))) < 2e-5:
            t, y, h = t + h, y + h * (first + second) / 2, 1.5 * h
        else:
            h /= 2
    return y


# --- Another solver inside, and classes --------------------------------------------------------


def solve_ivp_inside(acceleration, t, x, v, dt, args):
    """SciPy's DOP853 over each step: as good as exact."""

    def f(_, y):
        x, v = y.reshape(2, -1, 3)
        return np.concatenate([v.ravel(), accelerations(x, v, args).ravel()])

    y = np.concatenate([x.ravel(), v.ravel()])
    out = integrate.solve_ivp(f, (0.0, dt), y, method="DOP853", rtol=1e-13, atol=1e-14)
    x, v = out.y[:, -1].reshape(2, -1, 3)
    return x, v


class Undeclared(Stepper):
    """Semi-implicit Euler, which is symplectic; its author has not heard of that."""

    name = "an-euler"
    needs = "second order"

    def order(self, problem_class):
        return 1

    def step(self, system, t, y, dt):
        v = y.v + dt * system.acceleration(t, y.x, y.v)
        return Phase(y.x + dt * v, v)


# Where their style could be taken for a threshold.
_FAR = {"only": ["purity", "pins", "time-shift", "thresholds"]}
_FIRST, _SECOND, _FOURTH = ({"expected_order": order} for order in (1, 2, 4))

RIGHT_LOOPS: dict[str, tuple[Any, dict[str, Any]]] = {
    "overflowing": (overflowing, _FIRST),
    "pairs in turn": (pairs_in_turn, _FIRST),
    "Verlet in place": (verlet_in_place, {**_SECOND, "symplectic": True, "reversible": True}),
    "damping first": (damping_first, _FIRST),
    "sub-steps by stiffness": (sub_steps_by_stiffness, _SECOND),
    "RK4 in long double": (rk4_in_long_double, _FOURTH),
    "stopped early": (stopped_early, _FIRST),
    "linearly implicit": (linearly_implicit(linalg.solve), _FIRST),
    "one sweep": (linearly_implicit(one_sweep, definite=True), _FIRST),
    "conjugate gradients": (linearly_implicit(conjugate_gradients), _FIRST),
    "Rosenbrock": (rosenbrock2, _SECOND),
    "XPBD 1": (xpbd(1), _FIRST),
    "XPBD 60": (xpbd(60), _FIRST),
    # Where two nodes coincide its steps go to zero, and it does not end.
    "solve_ivp inside": (solve_ivp_inside, {"skip": ("zero-length",)}),
    "undeclared": (Undeclared, {}),
    "length + 1e-12": (guarded(lambda length: length + 1e-12), _FAR),
    "length of 1e-6 at least": (guarded(lambda length: np.maximum(length, 1e-6)), _FAR),
    "midpoint to 1e-6": (midpoint_to(1e-6), _FAR),
    "midpoint to 1e-12, or raises": (midpoint_to(1e-12, 200), _FAR),
    "for three dimensions": (for_three_dimensions, _FAR),
    "in parts": (in_parts, {**_FIRST, "only": ["thresholds"]}),
    "adaptive": (adaptive, {"only": ["rotation", "mirror", "units"]}),
}
