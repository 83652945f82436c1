"""Right steppers as people write them: loops, solvers by iteration, forces of their own.

Nobody who wrote one of these looked at the checks. Each comes with what is true of it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from scipy import integrate, linalg, optimize

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


def symplectic_in_loops(acceleration, t, x, v, dt, args):
    n, dim = x.shape
    force = [[0.0] * dim for _ in range(n)]
    for i in range(n):
        for c in range(dim):
            force[i][c] = args.mass[i] * args.gravity[c] - args.damping[i] * v[i, c]
    for s in range(n - 1):
        d = [x[s + 1, c] - x[s, c] for c in range(dim)]
        length = math.sqrt(sum(each * each for each in d))
        if length > 0.0:
            f = args.stiffness[s] * (length - args.rest_length[s]) / length
            for c in range(dim):
                force[s][c] += f * d[c]
                force[s + 1][c] -= f * d[c]
    x_new, v_new = x.copy(), v.copy()
    for i in range(n):
        if args.free[i]:
            for c in range(dim):
                v_new[i, c] = v[i, c] + dt * force[i][c] / args.mass[i]
                x_new[i, c] = x[i, c] + dt * v_new[i, c]
    return x_new, v_new


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


def explicit_in_place(acceleration, t, x, v, dt, args):
    x, v = x.copy(), v.copy()
    a = accelerations(x, v, args)
    x += dt * v
    v += dt * a
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


def exact_damping(acceleration, t, x, v, dt, args):
    """Strang: half the damping exactly, kick, drift, kick, half the damping."""
    half = np.exp(-0.5 * dt * args.free * args.damping / args.mass)[:, None]
    still = np.zeros_like(v)
    v = half * v
    v = v + 0.5 * dt * accelerations(x, still, args)
    x = x + dt * v
    v = v + 0.5 * dt * accelerations(x, still, args)
    return x, half * v


def damping_first(acceleration, t, x, v, dt, args):
    """Semi-implicit Euler with a factor exp(-rate dt)."""
    v = v * np.exp(-dt * args.free * args.damping / args.mass)[:, None]
    v = v + dt * accelerations(x, np.zeros_like(v), args)
    return x + dt * v, v


def damping_divided(acceleration, t, x, v, dt, args):
    """As many engines do: v / (1 + dt c / m)."""
    v = v + dt * accelerations(x, np.zeros_like(v), args)
    v = v / (1.0 + dt * args.free * args.damping / args.mass)[:, None]
    return x + dt * v, v


def sub_steps(acceleration, t, x, v, dt, args):
    """Eight small steps of semi-implicit Euler in each step."""
    for _ in range(8):
        v = v + dt / 8 * accelerations(x, v, args)
        x = x + dt / 8 * v
    return x, v


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


def rk4_of_vectors(acceleration, t, x, v, dt, args):
    """One flat vector, as for scipy."""

    def f(y):
        x, v = y[: x0.size].reshape(x0.shape), y[x0.size :].reshape(x0.shape)
        return np.concatenate([v.ravel(), accelerations(x, v, args).ravel()])

    x0 = x
    y = np.concatenate([x.ravel(), v.ravel()])
    k1 = f(y)
    k2 = f(y + 0.5 * dt * k1)
    k3 = f(y + 0.5 * dt * k2)
    k4 = f(y + dt * k3)
    y = y + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return y[: x0.size].reshape(x0.shape), y[x0.size :].reshape(x0.shape)


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


def verlet_in_long_double(acceleration, t, x, v, dt, args):
    """All of it in extended precision, forces too."""
    x, v, dt = x.astype(np.longdouble), v.astype(np.longdouble), np.longdouble(dt)
    args = args._replace(**{name: np.longdouble(getattr(args, name)) for name in args._fields})
    rate = (args.free * args.damping / args.mass)[:, None]
    still = np.zeros_like(v)
    v = v + dt / 2 * (accelerations(x, still, args) - rate * v)
    x = x + dt * v
    v = (v + dt / 2 * accelerations(x, still, args)) / (1 + dt / 2 * rate)
    return x.astype(np.float64), v.astype(np.float64)


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


def extrapolated(rhs, t, y, dt, args):
    """Gragg's modified midpoint rule with 2 and 4 substeps, extrapolated: order 4."""

    def gragg(n):
        h = dt / n
        before, now = y, y + h * rhs(t, y, args)
        for k in range(1, n):
            before, now = now, before + 2 * h * rhs(t + k * h, now, args)
        return 0.5 * (now + before + h * rhs(t + dt, now, args))

    return (4 * gragg(4) - gragg(2)) / 3


def euler_extrapolated(rhs, t, y, dt, args):
    """Two half steps twice, less one whole step."""
    whole = y + dt * rhs(t, y, args)
    half = y + dt / 2 * rhs(t, y, args)
    return 2 * (half + dt / 2 * rhs(t + dt / 2, half, args)) - whole


def predict_evaluate_correct(rhs, t, y, dt, args):
    """Heun's corrector iterated twice."""
    f0 = rhs(t, y, args)
    new = y + dt * f0
    for _ in range(2):
        new = y + dt / 2 * (f0 + rhs(t + dt, new, args))
    return new


def rk4_by_scan(rhs, t, y, dt, args):
    """The stages as a loop of JAX."""
    c = jnp.array([0.0, 0.5, 0.5, 1.0])
    b = jnp.array([1.0, 2.0, 2.0, 1.0]) / 6.0
    y = jnp.asarray(y)

    def stage(carry, cb):
        k, total = carry
        c, b = cb
        k = rhs(t + c * dt, y + c * dt * k, args)
        return (k, total + b * k), None

    (_, total), _ = jax.lax.scan(stage, (jnp.zeros_like(y), jnp.zeros_like(y)), (c, b))
    return y + dt * total


def two_half_steps(acceleration, t, x, v, dt, args):
    """Heun over each half, in JAX's fori_loop."""
    h = dt / 2

    def half(i, y):
        x, v = y
        s = t + i * h
        a = acceleration(s, x, v, args)
        b = acceleration(s + h, x + h * v, v + h * a, args)
        return x + h / 2 * (v + v + h * a), v + h / 2 * (a + b)

    return jax.lax.fori_loop(0, 2, half, (jnp.asarray(x), jnp.asarray(v)))


def compensated(acceleration, t, x, v, dt, args):
    """Velocity Verlet, with sums over springs by math.fsum."""

    def own(x, v):
        out = np.zeros_like(x)
        for i in range(len(x)):
            for c in range(x.shape[1]):
                terms = [args.mass[i] * args.gravity[c], -args.damping[i] * v[i, c]]
                for j, s in ((i - 1, i - 1), (i + 1, i)):
                    if 0 <= j < len(x):
                        length = math.dist(x[i], x[j])
                        if length > 0:
                            terms.append(
                                args.stiffness[s]
                                * (1.0 - args.rest_length[s] / length)
                                * (x[j, c] - x[i, c])
                            )
                out[i, c] = args.free[i] * math.fsum(terms) / args.mass[i]
        return out

    a = own(x, v)
    x = x + dt * v + 0.5 * dt * dt * a
    return x, v + 0.5 * dt * (a + own(x, v + dt * a))


def with_energy_monitor(acceleration, t, x, v, dt, args):
    """Semi-implicit Euler that also computes what it does not use."""
    v = v + dt * acceleration(t, x, v, args)
    x = x + dt * v
    energy = 0.5 * np.sum(args.mass[:, None] * np.asarray(v) ** 2)
    assert energy >= 0.0
    return x, v


def pins_put_back(acceleration, t, x, v, dt, args):
    """Moves all nodes, and puts the pinned ones back."""
    f = forces(x, v, args) / args.mass[:, None]
    v_new = v + dt * f
    x_new = x + dt * v_new
    pinned = args.free == 0
    x_new[pinned], v_new[pinned] = x[pinned], 0.0
    return x_new, v_new


def einsum_forces(acceleration, t, x, v, dt, args):
    """An incidence matrix in place of a loop."""
    n = len(x)
    b = np.eye(n - 1, n, 1) - np.eye(n - 1, n)
    d = b @ x
    length = np.sqrt(np.einsum("sc,sc->s", d, d))
    tension = args.stiffness * (1.0 - args.rest_length / np.where(length > 0, length, 1.0))
    f = -np.einsum("si,s,sc->ic", b, tension, d) + np.outer(args.mass, args.gravity)
    f -= args.damping[:, None] * v
    v = v + dt * f * (args.free / args.mass)[:, None]
    return x + dt * v, v


def guarded_length(acceleration, t, x, v, dt, args):
    """Lengths at least 1e-12."""
    d = x[1:] - x[:-1]
    length = np.maximum(np.linalg.norm(d, axis=1), 1e-12)
    pull = ((args.stiffness * (length - args.rest_length)) / length)[:, None] * d
    f = args.mass[:, None] * args.gravity - args.damping[:, None] * v
    np.add.at(f, np.arange(len(x) - 1), pull)
    np.subtract.at(f, np.arange(1, len(x)), pull)
    v = v + dt * args.free[:, None] * f / args.mass[:, None]
    return x + dt * v, v


# --- Implicit methods --------------------------------------------------------------------------


def _flat(x, v, args):
    free = np.repeat(args.free > 0, x.shape[1])
    mass = np.repeat(args.mass, x.shape[1])
    rate = np.repeat(args.damping, x.shape[1])
    return free, mass, rate


def newton(residual, derivative, x, iterations=30, tolerance=1e-13):
    """The root, with a full step each time."""
    for _ in range(iterations):
        dx = np.linalg.solve(derivative(x), -residual(x))
        x = x + dx
        if np.max(np.abs(dx), initial=0.0) <= tolerance * (1.0 + np.max(np.abs(x))):
            break
    return x


def positions_after(h, x, v, args):
    """Backward Euler over the time h: Newton's method for the new positions of the free nodes."""
    free, mass, c = _flat(x, v, args)
    x0, v0 = x.ravel(), v.ravel()

    def whole(z):
        out = x0.copy()
        out[free] = z
        return out

    def residual(z):
        y = whole(z)
        f = forces(y.reshape(x.shape), (y - x0).reshape(x.shape) / h, args).ravel()
        return (mass * (y - x0 - h * v0) - h**2 * f)[free]

    def derivative(z):
        k = stiffness_matrix(whole(z).reshape(x.shape), args)
        return (np.diag(mass + h * c) - h**2 * k)[np.ix_(free, free)]

    return whole(newton(residual, derivative, (x0 + h * v0)[free])).reshape(x.shape)


def implicit_euler_by_newton(acceleration, t, x, v, dt, args):
    """Backward Euler."""
    new = positions_after(dt, x, v, args)
    return new, (new - x) / dt


def midpoint_by_newton(acceleration, t, x, v, dt, args):
    """Implicit midpoint: half a step of backward Euler, twice as far."""
    middle = positions_after(0.5 * dt, x, v, args)
    v_middle = (middle - x) / (0.5 * dt)
    return 2 * middle - x, (2 * v_middle - v) * args.free[:, None]


def trapezium_by_fixed_point(acceleration, t, x, v, dt, args):
    """Until nothing changes any more, at most 200 times."""
    a = acceleration(t, x, v, args)
    x_new, v_new = x + dt * v, v + dt * a
    for _ in range(200):
        before = x_new, v_new
        v_new = v + dt / 2 * (a + acceleration(t + dt, x_new, v_new, args))
        x_new = x + dt / 2 * (v + v_new)
        if np.array_equal(before[0], x_new) and np.array_equal(before[1], v_new):
            break
    return x_new, v_new


def implicit_euler_by_fixed_point(rhs, t, y, dt, args):
    """Stopped by a tolerance of 1e-13."""
    new = y
    for _ in range(500):
        before, new = new, y + dt * rhs(t + dt, new, args)
        if np.max(np.abs(new - before)) < 1e-13:
            break
    return new


def stopped_early(rhs, t, y, dt, args):
    """The same, but with a tolerance of 1e-8: each step leaves an error of up to that."""
    new = y + dt * rhs(t, y, args)
    for _ in range(100):
        before, new = new, y + dt * rhs(t + dt, new, args)
        if np.max(np.abs(np.asarray(new - before))) < 1e-8:
            break
    return new


def implicit_euler_by_fsolve(acceleration, t, x, v, dt, args):
    """SciPy's root finder with its tightest tolerance."""
    free = args.free > 0

    def residual(z):
        v_new = np.zeros_like(v)
        v_new[free] = z.reshape(-1, x.shape[1])
        a = accelerations(x + dt * v_new, v_new, args)
        return (v_new - v - dt * a)[free].ravel()

    root = optimize.fsolve(residual, v[free].ravel(), xtol=1e-15)
    v_new = np.zeros_like(v)
    v_new[free] = root.reshape(-1, x.shape[1])
    return x + dt * v_new, v_new


def linearly_implicit(acceleration, t, x, v, dt, args):
    """Baraff and Witkin 1998: one linear system, one Newton step of backward Euler."""
    free, mass, c = _flat(x, v, args)
    k = stiffness_matrix(x, args)
    f = forces(x, v, args).ravel()
    matrix = np.diag(mass + dt * c) - dt**2 * k
    right = dt * (f + dt * k @ np.where(free, v.ravel(), 0.0))
    dv = np.zeros(x.size)
    dv[free] = linalg.solve(matrix[np.ix_(free, free)], right[free])
    v_new = v + dv.reshape(v.shape)
    return x + dt * v_new, v_new


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


def crank_nicolson_in_jax(acceleration, t, x, v, dt, args):
    """The trapezoidal rule, Newton's method in JAX, six iterations."""
    x, v = jnp.asarray(x), jnp.asarray(v)
    a = acceleration(t, x, v, args)

    def residual(z):
        w = z.reshape(v.shape)
        there = x + dt / 2 * (v + w)
        return (w - v - dt / 2 * (a + acceleration(t + dt, there, w, args))).ravel()

    def better(_, z):
        return z - jnp.linalg.solve(jax.jacfwd(residual)(z), residual(z))

    w = jax.lax.fori_loop(0, 6, better, v.ravel()).reshape(v.shape)
    return x + dt / 2 * (v + w), w


def half_implicit(acceleration, t, x, v, dt, args):
    """IMEX: damping backward, springs forward; Newmark's velocity is explicit."""
    rate = (args.free * args.damping / args.mass)[:, None]
    a = acceleration(t, x, jnp.zeros_like(x), args)
    v = (v + dt * a) / (1.0 + dt * rate)
    return x + dt * v, v


def newmark(acceleration, t, x, v, dt, args):
    """Newmark, beta 1/4 and gamma 1/2, by Newton's method for the acceleration."""
    free, mass, c = _flat(x, v, args)
    a0 = accelerations(x, v, args)

    def at(z):
        a = np.zeros(x.size)
        a[free] = z
        a = a.reshape(x.shape)
        return x + dt * v + dt**2 * (0.25 * a0 + 0.25 * a), v + dt / 2 * (a0 + a), a

    def residual(z):
        xn, vn, a = at(z)
        return (mass * a.ravel() - forces(xn, vn, args).ravel())[free]

    def derivative(z):
        k = stiffness_matrix(at(z)[0], args)
        return (np.diag(mass + dt / 2 * c) - dt**2 / 4 * k)[np.ix_(free, free)]

    xn, vn, _ = at(newton(residual, derivative, a0.ravel()[free]))
    return xn, vn


def minimised(acceleration, t, x, v, dt, args):
    """Backward Euler as the minimum of an energy, by Newton with a line search (projective)."""
    free, mass, c = _flat(x, v, args)
    x0 = x.ravel()
    target = (x + dt * v).ravel() + dt**2 * np.tile(args.gravity, len(x))

    def energy(y):
        d = np.diff(y.reshape(x.shape), axis=0)
        stretch = np.linalg.norm(d, axis=1) - args.rest_length
        return (
            np.sum(mass * (y - target) ** 2) / 2
            + dt**2 * np.sum(args.stiffness * stretch**2) / 2
            + dt * np.sum(c * (y - x0) ** 2) / 2
        )

    def gradient(y):
        still = args._replace(gravity=0.0 * args.gravity)
        f = forces(y.reshape(x.shape), (y - x0).reshape(x.shape) / dt, still).ravel()
        return mass * (y - target) - dt**2 * f

    y = np.where(free, target, x0)
    for _ in range(50):
        hessian = np.diag(mass + dt * c) - dt**2 * stiffness_matrix(y.reshape(x.shape), args)
        g = gradient(y)[free]
        step = np.linalg.solve(hessian[np.ix_(free, free)], -g)
        if step @ g > 0:
            step = -g
        size, start = 1.0, energy(y)
        while size > 1e-3:
            trial = y.copy()
            trial[free] += size * step
            if energy(trial) <= start + 1e-14 * abs(start):
                break
            size /= 2
        y = trial
        if np.max(np.abs(step), initial=0.0) < 1e-14 * (1 + np.max(np.abs(y))):
            break
    return y.reshape(x.shape), (y - x0).reshape(x.shape) / dt


# --- Position based dynamics, springs as compliant constraints ---------------------------------


def xpbd(iterations: int, reverse: bool = False) -> Callable:
    """Macklin, Mueller, Chentanez 2016: compliance 1/k, Gauss-Seidel over the springs."""

    def step(acceleration, t, x, v, dt, args):
        w = args.free / args.mass
        v = v + dt * args.free[:, None] * args.gravity
        v = v / (1.0 + dt * w * args.damping)[:, None]
        p = x + dt * v
        alpha = 1.0 / args.stiffness / dt**2
        lam = np.zeros(len(x) - 1)
        springs = range(len(x) - 1)
        for _ in range(iterations):
            for s in reversed(springs) if reverse else springs:
                d = p[s + 1] - p[s]
                length = np.sqrt(d @ d)
                if length < 1e-12 or w[s] + w[s + 1] == 0:
                    continue
                n = d / length
                c = length - args.rest_length[s]
                change = (-c - alpha[s] * lam[s]) / (w[s] + w[s + 1] + alpha[s])
                lam[s] += change
                p[s] -= w[s] * change * n
                p[s + 1] += w[s + 1] * change * n
        return p, (p - x) / dt

    step.__name__ = f"xpbd_{iterations}{'_reversed' if reverse else ''}"
    return step


def xpbd_in_plain_python(acceleration, t, x, v, dt, args):
    """Lists of floats, so that 1/0 raises."""
    n = len(x)
    w = [float(f) / float(m) for f, m in zip(args.free, args.mass, strict=True)]
    v = [[float(c) for c in row] for row in v]
    p = [[float(c) for c in row] for row in x]
    for i in range(n):
        if w[i] > 0.0:
            factor = 1.0 / (1.0 + dt * w[i] * float(args.damping[i]))
            for c in range(3):
                v[i][c] = (v[i][c] + dt * float(args.gravity[c])) * factor
                p[i][c] += dt * v[i][c]
    lam = [0.0] * (n - 1)
    for _ in range(60):
        for s in range(n - 1):
            alpha = 1.0 / float(args.stiffness[s]) / (dt * dt)
            d = [p[s + 1][c] - p[s][c] for c in range(3)]
            length = math.sqrt(d[0] ** 2 + d[1] ** 2 + d[2] ** 2)
            if length == 0.0 or w[s] + w[s + 1] == 0.0:
                continue
            change = (float(args.rest_length[s]) - length - alpha * lam[s]) / (
                w[s] + w[s + 1] + alpha
            )
            lam[s] += change
            for c in range(3):
                p[s][c] -= w[s] * change * d[c] / length
                p[s + 1][c] += w[s + 1] * change * d[c] / length
    new = np.array(p)
    return new, (new - x) / dt


def xpbd_small_steps(acceleration, t, x, v, dt, args):
    """Macklin and others 2019: twenty substeps with one iteration each."""
    one = xpbd(1)
    for _ in range(20):
        x, v = one(acceleration, t, x, v, dt / 20, args)
    return x, v


def projective(acceleration, t, x, v, dt, args):
    """Projective dynamics (Bouaziz and others 2014): local and global steps to convergence."""
    n = len(x)
    free = args.free > 0
    b = np.eye(n - 1, n, 1) - np.eye(n - 1, n)
    left = np.diag(args.mass + dt * args.damping) + dt**2 * b.T @ np.diag(args.stiffness) @ b
    y = x + dt * v + dt**2 * args.gravity
    y[~free] = x[~free]
    right0 = args.mass[:, None] * (x + dt * v + dt**2 * args.gravity)
    right0 = right0 + dt * args.damping[:, None] * x
    for _ in range(400):
        d = b @ y
        length = np.linalg.norm(d, axis=1, keepdims=True)
        p = args.rest_length[:, None] * d / np.where(length > 0, length, 1.0)
        right = right0 + dt**2 * b.T @ (args.stiffness[:, None] * p)
        right = right[free] - left[np.ix_(free, ~free)] @ x[~free]
        new = np.linalg.solve(left[np.ix_(free, free)], right)
        change = np.max(np.abs(new - y[free]), initial=0.0)
        y[free] = new
        if change < 1e-15:
            break
    return y, (y - x) / dt


def gauss_seidel(sweeps: int) -> Callable:
    """Linearly implicit Euler (Baraff and Witkin), its system solved by sweeps over the nodes."""

    def step(acceleration, t, x, v, dt, args):
        free, mass, c = _flat(x, v, args)
        k = stiffness_matrix(x, args, definite=True)
        a = np.diag(mass + dt * c) - dt**2 * k
        right = dt * (forces(x, v, args).ravel() + dt * k @ np.where(free, v.ravel(), 0.0))
        dv = np.zeros(x.size)
        for _ in range(sweeps):
            for i in np.flatnonzero(free):
                dv[i] += (right[i] - a[i, free] @ dv[free]) / a[i, i]
        v_new = v + dv.reshape(v.shape)
        return x + dt * v_new, v_new

    step.__name__ = f"gauss_seidel_{sweeps}"
    return step


def conjugate_gradients(acceleration, t, x, v, dt, args):
    """The same by conjugate gradients, to 1e-6 of the right-hand side."""
    free, mass, c = _flat(x, v, args)
    k = stiffness_matrix(x, args)
    a = (np.diag(mass + dt * c) - dt**2 * k)[np.ix_(free, free)]
    b = (dt * (forces(x, v, args).ravel() + dt * k @ np.where(free, v.ravel(), 0.0)))[free]
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
    dv = np.zeros(x.size)
    dv[free] = z
    v_new = v + dv.reshape(v.shape)
    return x + dt * v_new, v_new


# --- Another solver inside ---------------------------------------------------------------------


def solve_ivp_inside(acceleration, t, x, v, dt, args):
    """SciPy's DOP853 over each step: as good as exact."""

    def f(_, y):
        x, v = y.reshape(2, -1, 3)
        return np.concatenate([v.ravel(), accelerations(x, v, args).ravel()])

    y = np.concatenate([x.ravel(), v.ravel()])
    out = integrate.solve_ivp(f, (0.0, dt), y, method="DOP853", rtol=1e-13, atol=1e-14)
    x, v = out.y[:, -1].reshape(2, -1, 3)
    return x, v


# --- Classes -----------------------------------------------------------------------------------


class Two(NamedTuple):
    now: Any
    before: Any


class Bdf2(Stepper):
    """Backward differentiation, Newton's method in JAX; the first step is backward Euler."""

    name = "bdf2"
    needs = "any ODE"
    equal_frames = True

    def order(self, problem_class):
        return 2

    def init(self, system, t, y, dt):
        before = y - dt * system.rhs(t, y)
        before = y - dt / 2 * (system.rhs(t, y) + system.rhs(t - dt, before))
        return Two(y, before)

    def step(self, system, t, carried, dt):
        y, before = carried
        x, v = jnp.asarray(y.x), jnp.asarray(y.v)
        base = (4.0 * y - before) / 3.0

        def residual(z):
            xn, vn = z.reshape(2, *x.shape)
            slope = system.rhs(t + dt, Phase(xn, vn))
            return jnp.concatenate(
                [
                    (xn - base.x - 2 * dt / 3 * slope.x).ravel(),
                    (vn - base.v - 2 * dt / 3 * slope.v).ravel(),
                ]
            )

        z = jnp.concatenate([x.ravel(), v.ravel()])
        for _ in range(5):
            z = z - jnp.linalg.solve(jax.jacfwd(residual)(z), residual(z))
        xn, vn = z.reshape(2, *x.shape)
        return Two(Phase(xn, vn), y)

    def state(self, system, t, carried, dt):
        return carried.now


class ImplicitEulerClass(Stepper):
    """Backward Euler in NumPy, Newton's method with a Jacobian from differences."""

    name = "backward-euler"
    needs = "second order"

    def order(self, problem_class):
        return 1

    def step(self, system, t, y, dt):
        x, v = np.asarray(y.x), np.asarray(y.v)

        def residual(w):
            w = w.reshape(v.shape)
            return (w - v - dt * np.asarray(system.acceleration(t + dt, x + dt * w, w))).ravel()

        w = v.ravel()
        for _ in range(8):
            r = residual(w)
            jacobian = np.empty((w.size, w.size))
            for i in range(w.size):
                d = np.zeros(w.size)
                d[i] = 1e-6
                jacobian[:, i] = (residual(w + d) - residual(w - d)) / 2e-6
            dw = np.linalg.solve(jacobian, -r)
            w = w + dw
            if np.max(np.abs(dw)) < 1e-14 * (1 + np.max(np.abs(w))):
                break
        w = w.reshape(v.shape)
        return Phase(x + dt * w, w)


class MidpointClass(Stepper):
    """Implicit midpoint by fixed-point iteration; nothing but an order is declared."""

    name = "implicit-midpoint"

    def order(self, problem_class):
        return 2

    def step(self, system, t, y, dt):
        k = system.rhs(t, y)
        for _ in range(60):
            k = system.rhs(t + dt / 2, y + dt / 2 * k)
        return y + dt * k


class Leapfrog(Stepper):
    """Velocities half a step behind; the state has those of the full step."""

    name = "staggered-leapfrog"
    needs = "second order, linear damping"
    equal_frames = True

    def order(self, problem_class):
        return 2

    def init(self, system, t, y, dt):
        a = system.acceleration(t, y.x, y.v)
        return y.x, y.v - dt / 2 * a + dt**2 / 8 * self._jerk(system, t, y, a, dt / 16)

    def _jerk(self, system, t, y, a, h):
        return (
            system.acceleration(t + h, y.x + h * y.v, y.v + h * a)
            - system.acceleration(t - h, y.x - h * y.v, y.v - h * a)
        ) / (2 * h)

    def step(self, system, t, carried, dt):
        x, v = carried
        half = system.damping.rate * dt / 2
        v = ((1 - half) * v + dt * system.undamped_acceleration(t, x)) / (1 + half)
        return x + dt * v, v

    def state(self, system, t, carried, dt):
        x, v = carried
        half = system.damping.rate * dt / 2
        return Phase(x, (v + dt / 2 * system.undamped_acceleration(t, x)) / (1 + half))


class AdamsMoulton(Stepper):
    """Predicted by Adams and Bashforth, corrected by Adams and Moulton, evaluated: order 3."""

    name = "abm3"
    needs = "any ODE"
    equal_frames = True

    def order(self, problem_class):
        return 3

    def init(self, system, t, y, dt):
        def back(t, y):
            k1 = system.rhs(t, y)
            k2 = system.rhs(t - dt / 2, y - dt / 2 * k1)
            k3 = system.rhs(t - dt / 2, y - dt / 2 * k2)
            k4 = system.rhs(t - dt, y - dt * k3)
            return y - dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)

        one = back(t, y)
        two = back(t - dt, one)
        return y, system.rhs(t, y), system.rhs(t - dt, one), system.rhs(t - 2 * dt, two)

    def step(self, system, t, carried, dt):
        y, f0, f1, f2 = carried
        guess = y + dt / 12 * (23 * f0 - 16 * f1 + 5 * f2)
        new = y + dt / 12 * (5 * system.rhs(t + dt, guess) + 8 * f0 - f1)
        return new, system.rhs(t + dt, new), f0, f1

    def state(self, system, t, carried, dt):
        return carried[0]


class Cached(Stepper):
    """Velocity Verlet that keeps the last acceleration: one evaluation per step."""

    name = "verlet-fsal"
    needs = "second order"
    symplectic = None

    def order(self, problem_class):
        return 2

    def init(self, system, t, y, dt):
        return y.x, y.v, system.acceleration(t, y.x, y.v)

    def step(self, system, t, carried, dt):
        x, v, a = carried
        x = x + dt * v + dt**2 / 2 * a
        guess = v + dt * a
        v = v + dt / 2 * (a + system.acceleration(t + dt, x, guess))
        return x, v, system.acceleration(t + dt, x, v)

    def state(self, system, t, carried, dt):
        return Phase(carried[0], carried[1])


class Undeclared(Stepper):
    """Semi-implicit Euler, which is symplectic; its author has not heard of that."""

    name = "an-euler"
    needs = "second order"

    def order(self, problem_class):
        return 1

    def step(self, system, t, y, dt):
        v = y.v + dt * system.acceleration(t, y.x, y.v)
        return Phase(y.x + dt * v, v)


class Optioned(Stepper):
    """theta method by fixed-point iteration, with theta given to the object."""

    name = "theta"

    def __init__(self, theta: float):
        self.theta = theta

    def order(self, problem_class):
        return 2 if self.theta == 0.5 else 1

    def step(self, system, t, y, dt):
        f = system.rhs(t, y)
        new = y + dt * f
        for _ in range(60):
            new = y + dt * ((1 - self.theta) * f + self.theta * system.rhs(t + dt, new))
        return new


_FIRST, _SECOND = {"expected_order": 1}, {"expected_order": 2}

RIGHT_LOOPS: dict[str, tuple[Any, dict[str, Any]]] = {
    **{
        step.__name__: (step, claims)
        for step, claims in (
            (symplectic_in_loops, {**_FIRST, "symplectic": True}),
            (overflowing, _FIRST),
            (pairs_in_turn, _FIRST),
            (explicit_in_place, {**_FIRST, "symplectic": False}),
            (verlet_in_place, {**_SECOND, "symplectic": True, "reversible": True}),
            (exact_damping, {**_SECOND, "symplectic": True}),
            (damping_first, _FIRST),
            (damping_divided, _FIRST),
            (sub_steps, _FIRST),
            (sub_steps_by_stiffness, _SECOND),
            (rk4_of_vectors, {"expected_order": 4}),
            (rk4_in_long_double, {"expected_order": 4}),
            (verlet_in_long_double, _SECOND),
            (nystrom4, {"expected_order": 4}),
            (taylor2, _SECOND),
            (extrapolated, {"expected_order": 4}),
            (euler_extrapolated, _SECOND),
            (predict_evaluate_correct, _SECOND),
            (rk4_by_scan, {"expected_order": 4}),
            (two_half_steps, _SECOND),
            (compensated, _SECOND),
            (with_energy_monitor, _FIRST),
            (pins_put_back, _FIRST),
            (einsum_forces, _FIRST),
            (guarded_length, _FIRST),
            (implicit_euler_by_newton, _FIRST),
            (midpoint_by_newton, _SECOND),
            (trapezium_by_fixed_point, _SECOND),
            (implicit_euler_by_fixed_point, _FIRST),
            (stopped_early, _FIRST),
            (implicit_euler_by_fsolve, _FIRST),
            (linearly_implicit, _FIRST),
            (rosenbrock2, _SECOND),
            (crank_nicolson_in_jax, _SECOND),
            (half_implicit, _FIRST),
            (newmark, _SECOND),
            (minimised, _FIRST),
            (xpbd(60), _FIRST),
            (xpbd(60, reverse=True), _FIRST),
            (xpbd(3), _FIRST),
            (xpbd(1), _FIRST),
            (xpbd_in_plain_python, _FIRST),
            (xpbd_small_steps, _FIRST),
            (projective, _FIRST),
            (gauss_seidel(1), _FIRST),
            (gauss_seidel(3), _FIRST),
            (gauss_seidel(40), _FIRST),
            (conjugate_gradients, _FIRST),
            # Where two nodes coincide its steps go to zero, and it does not end.
            (solve_ivp_inside, {"skip": ("zero-length",)}),
        )
    },
    "bdf2": (Bdf2, {}),
    "implicit Euler, a class": (ImplicitEulerClass, {}),
    "implicit midpoint, a class": (MidpointClass, {}),
    "staggered leapfrog": (Leapfrog, {}),
    "adams-moulton": (AdamsMoulton, {}),
    "verlet, one evaluation": (Cached, {}),
    "semi-implicit euler, undeclared": (Undeclared, {}),
    "theta 0.5": (Optioned(0.5), {}),
    "theta 0.7": (Optioned(0.7), {}),
}
