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
from scipy import integrate, linalg

from ropeode.steppers import Phase, Stepper


def forces(x, v, args):
    """Of springs, gravity and damping, as arrays."""
    d = np.diff(x, axis=0)
    length = np.linalg.norm(d, axis=1, keepdims=True)
    n = np.divide(d, length, out=np.zeros_like(d), where=length > 0)
    pull = args.stiffness[:, None] * (length - args.rest_length[:, None]) * n
    f = args.mass[:, None] * args.gravity - args.damping[:, None] * v
    f[:-1] += pull
    f[1:] -= pull
    return f


def accelerations(x, v, args):
    return args.free[:, None] * forces(x, v, args) / args.mass[:, None]


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
    """Explicit Euler in floats of Python, which overflow with an exception where it blows up."""
    n = len(x)
    a = [[float(g) for g in args.gravity] for _ in range(n)]
    for i in range(n):
        for c in range(3):
            a[i][c] -= float(args.damping[i]) * float(v[i, c]) / float(args.mass[i])
    for s in range(n - 1):
        d = [float(x[s + 1, c]) - float(x[s, c]) for c in range(3)]
        length = (d[0] ** 2 + d[1] ** 2 + d[2] ** 2) ** 0.5
        if length > 0.0:
            for c in range(3):
                f = float(args.stiffness[s]) * (length - float(args.rest_length[s])) * d[c] / length
                a[s][c] += f / float(args.mass[s])
                a[s + 1][c] -= f / float(args.mass[s + 1])
    a = args.free[:, None] * np.array(a)
    return x + dt * v, v + dt * a


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


def nystrom4(acceleration, t, x, v, dt, args):
    """Hairer, Norsett, Wanner, section II.14: Nystrom's method of order 4 for x'' = f(t, x, x')."""
    k1 = acceleration(t, x, v, args)
    k2 = acceleration(t + dt / 2, x + dt / 2 * v + dt**2 / 8 * k1, v + dt / 2 * k1, args)
    k3 = acceleration(t + dt / 2, x + dt / 2 * v + dt**2 / 8 * k1, v + dt / 2 * k2, args)
    k4 = acceleration(t + dt, x + dt * v + dt**2 / 2 * k3, v + dt * k3, args)
    return x + dt * v + dt**2 / 6 * (k1 + k2 + k3), v + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def taylor2(rhs, t, y, dt, args):
    """The second derivative by forward differentiation."""
    y = jnp.asarray(y)
    first, second = jax.jvp(lambda t, y: rhs(t, y, args), (t, y), (1.0, rhs(t, y, args)))
    return y + dt * first + dt**2 / 2 * second


# --- Implicit methods --------------------------------------------------------------------------


def _flat(x, v, args):
    free = np.repeat(args.free > 0, x.shape[1])
    mass = np.repeat(args.mass, x.shape[1])
    rate = np.repeat(args.damping, x.shape[1])
    return free, mass, rate


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
        free, mass, c = _flat(x, v, args)
        k = stiffness_matrix(x, args, definite)
        matrix = np.diag(mass + dt * c) - dt**2 * k
        right = dt * (forces(x, v, args).ravel() + dt * k @ np.where(free, v.ravel(), 0.0))
        dv = np.zeros(x.size)
        dv[free] = solve(matrix[np.ix_(free, free)], right[free])
        v_new = v + dv.reshape(v.shape)
        return x + dt * v_new, v_new

    return step


def one_sweep(a, b):
    """Of Gauss and Seidel, over the unknowns."""
    z = np.zeros_like(b)
    for i in range(len(b)):
        z[i] = (b[i] - a[i] @ z) / a[i, i]
    return z


def conjugate_gradients(a, b):
    """To 1e-6 of the right-hand side."""
    z, r = np.zeros_like(b), b.copy()
    p, rr = r.copy(), r @ r
    for _ in range(3 * len(b)):
        if rr <= 1e-12 * (b @ b):
            break
        ap = a @ p
        s = rr / (p @ ap)
        z, r = z + s * p, r - s * ap
        rr, old = r @ r, rr
        p = r + rr / old * p
    return z


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


_FIRST, _SECOND, _FOURTH = ({"expected_order": order} for order in (1, 2, 4))

RIGHT_LOOPS: dict[str, tuple[Any, dict[str, Any]]] = {
    "overflowing": (overflowing, _FIRST),
    "pairs in turn": (pairs_in_turn, _FIRST),
    "Verlet in place": (verlet_in_place, {**_SECOND, "symplectic": True, "reversible": True}),
    "damping first": (damping_first, _FIRST),
    "sub-steps by stiffness": (sub_steps_by_stiffness, _SECOND),
    "RK4 in long double": (rk4_in_long_double, _FOURTH),
    "Nystrom": (nystrom4, _FOURTH),
    "Taylor": (taylor2, _SECOND),
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
}
