"""Mutants whose symptoms are rare or small, and those that carry what a step must not."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from tests.checking.mutants.mutant import Mutant, replaced
from tests.checking.mutants.originals import (
    ORIGINALS,
    explicit_euler,
    heun,
    leapfrog,
    midpoint,
    own_verlet,
    position_verlet,
    rk4,
    semi_implicit_euler,
    velocity_verlet,
)

_END = "    return x_new, v_new"


def _at_end(original: Callable, what: str, *lines: str) -> Mutant:
    """With lines before it returns."""
    return replaced(original, what, (_END, "".join(f"    {line}\n" for line in lines) + _END))


_SMALL = (
    _at_end(velocity_verlet, "growth of 1e-3", "v_new = v_new * (1 + 1e-3 * dt)"),
    _at_end(velocity_verlet, "growth of 1e-6", "v_new = v_new * (1 + 1e-6 * dt)"),
    _at_end(semi_implicit_euler, "growth of 1e-3", "v_new = v_new * (1 + 1e-3 * dt)"),
    _at_end(explicit_euler, "growth of 1e-2", "v_new = v_new * (1 + 1e-2 * dt)"),
    _at_end(velocity_verlet, "drift of 1e-3 dt^2", "x_new = x_new + 1e-3 * dt**2 * x"),
    replaced(rk4, "growth of 1e-9", ("    return y", "    return y * (1 + 1e-9 * dt)")),
    replaced(rk4, "constant of 1e-8", ("    return y", "    return 1e-8 * dt + y")),
    replaced(rk4, "order 2 by a term of 1e-3", ("2 * k3 + k4)", "2 * k3 + k4 + 1e-3 * (k2 - k1))")),
    replaced(
        semi_implicit_euler,
        "gravity of a hundredth more",
        ("v + dt * a", "v + dt * (a + 0.01 * args.free[:, None] * args.gravity)"),
    ),
    replaced(
        explicit_euler,
        "gravity of a thousandth more",
        ("v + dt * a", "v + dt * (a + 0.001 * args.free[:, None] * args.gravity)"),
    ),
    replaced(
        velocity_verlet,
        "gravity of g = 9.80665 for 9.81",
        (
            "    x_new",
            "    a = a - (1 - 9.80665 / 9.81) * args.free[:, None] * args.gravity\n    x_new",
        ),
    ),
)

_SOMEWHERE = (
    _at_end(
        velocity_verlet,
        "Euler along z",
        "x_new = x_new - np.array([0.0, 0.0, 1.0]) * dt**2 / 2 * a",
    ),
    _at_end(
        velocity_verlet,
        "Euler along x for the velocities",
        "v_new = v_new - np.array([1.0, 0.0, 0.0]) * dt / 2 * (a_new - a)",
    ),
    _at_end(
        velocity_verlet,
        "Euler at the last node",
        "last = np.arange(5.0)[:, None] == 4",
        "x_new = x_new - last * dt**2 / 2 * a",
    ),
    _at_end(
        velocity_verlet,
        "Euler next to the last node",
        "there = np.arange(5.0)[:, None] == 3",
        "v_new = v_new + there * dt / 2 * (a - a_new)",
    ),
    _at_end(velocity_verlet, "velocities halfway", "v_new = v + dt / 2 * a"),
    _at_end(
        semi_implicit_euler,
        "explicit along x",
        "x_new = x_new - np.array([1.0, 0.0, 0.0]) * dt**2 * a",
    ),
    _at_end(
        semi_implicit_euler,
        "explicit at odd nodes",
        "x_new = x_new - (np.arange(5.0) % 2)[:, None] * dt**2 * a",
    ),
    _at_end(semi_implicit_euler, "flat", "x_new = x_new * np.array([1.0, 1.0, 0.0])"),
    _at_end(
        leapfrog,
        "damping at the last node left out",
        "v_new = v_new + dt * (np.arange(5.0)[:, None] == 4) * rate * v_new",
    ),
    _at_end(
        position_verlet,
        "x and z swapped in the last term",
        "x_new = x_half + dt / 2 * v_new[:, ::-1]",
    ),
    _at_end(velocity_verlet, "velocity from the positions", "v_new = (x_new - x) / dt"),
)

_SOMETIMES = (
    _at_end(velocity_verlet, "Euler for t > 1", "x_new = x_new - (t > 1) * dt**2 / 2 * a"),
    _at_end(
        velocity_verlet, "no force for t > 2", "v_new = v_new - (t > 2) * dt / 2 * (a + a_new)"
    ),
    replaced(
        rk4, "order 2 for t > 1", ("    return y", "    return (t > 1) * (dt * (k2 - k4) / 6) + y")
    ),
    replaced(
        rk4, "order 1 for t < 0", ("    return y", "    return (t < 0) * (dt * (k1 - k4) / 6) + y")
    ),
    replaced(
        velocity_verlet,
        "asleep where it is slow",
        (_END, "    v_new = v_new * (v_new**2 > 1e-4)\n" + _END),
    ),
    replaced(
        velocity_verlet,
        "speed limit of 1",
        (_END, "    v_new = v_new / (1 + (abs(v_new) > 1) * (abs(v_new) - 1))\n" + _END),
    ),
    replaced(
        velocity_verlet,
        "speed limit of 100",
        (_END, "    v_new = v_new / (1 + (abs(v_new) > 100) * (abs(v_new) / 100 - 1))\n" + _END),
    ),
    _at_end(
        velocity_verlet,
        "floor at y = -1",
        "above = (x_new > -1) + (np.arange(3.0) != 1) > 0",
        "x_new = x_new * above - (1.0 - above)",
    ),
    _at_end(
        velocity_verlet,
        "floor at y = -100",
        "above = (x_new > -100) + (np.arange(3.0) != 1) > 0",
        "x_new = x_new * above - 100 * (1.0 - above)",
    ),
    replaced(
        velocity_verlet,
        "longest step 1/60",
        ("    a = ", "    dt = dt - (dt > 1 / 60) * (dt - 1 / 60)\n    a = "),
    ),
    replaced(
        velocity_verlet,
        "shortest step 1/60",
        ("    a = ", "    dt = dt + (dt < 1 / 60) * (1 / 60 - dt)\n    a = "),
    ),
    replaced(velocity_verlet, "always 1/60", ("    a = ", "    dt = 1 / 60\n    a = ")),
    replaced(
        velocity_verlet,
        "time to two digits",
        ("    a = ", "    t = np.round(float(t), 2)\n    a = "),
    ),
    replaced(heun, "dt to three digits", ("    k1", "    dt = np.round(float(dt), 3)\n    k1")),
    replaced(midpoint, "time from 0", ("    k1", "    t = abs(t)\n    k1")),
)

_DIGITS = (
    replaced(
        rk4,
        "float32",
        (
            "    k1 = rhs(t, y, args)",
            "    y = y.astype(np.float32).astype(float)\n    k1 = rhs(t, y, args)",
        ),
    ),
    replaced(
        rk4,
        "forces in float32",
        ("k1 = rhs(t, y, args)", "k1 = rhs(t, y, args).astype(np.float32).astype(float)"),
    ),
    replaced(rk4, "time in float32", ("    k1", "    t = np.float32(float(t))\n    k1")),
    replaced(
        velocity_verlet,
        "float32",
        (
            _END,
            "    x_new, v_new = (y.astype(np.float32).astype(float) for y in (x_new, v_new))\n"
            + _END,
        ),
    ),
    replaced(
        velocity_verlet,
        "positions in float32",
        (_END, "    x_new = x_new.astype(np.float32).astype(float)\n" + _END),
    ),
    replaced(
        velocity_verlet,
        "forces in float32",
        ("    x_new", "    a = a.astype(np.float32).astype(float)\n    x_new"),
        ("    v_new", "    a_new = a_new.astype(np.float32).astype(float)\n    v_new"),
    ),
    replaced(
        semi_implicit_euler,
        "float32",
        (
            _END,
            "    x_new, v_new = (y.astype(np.float32).astype(float) for y in (x_new, v_new))\n"
            + _END,
        ),
    ),
    replaced(
        semi_implicit_euler,
        "forces in float32",
        ("    v_new", "    a = a.astype(np.float32).astype(float)\n    v_new"),
    ),
    replaced(
        explicit_euler,
        "float16",
        (
            _END,
            "    x_new, v_new = (y.astype(np.float16).astype(float) for y in (x_new, v_new))\n"
            + _END,
        ),
    ),
    replaced(
        own_verlet,
        "float32",
        (
            "    a = ",
            "    x, v = (each.astype(np.float32).astype(float) for each in (x, v))\n    a = ",
        ),
    ),
    replaced(own_verlet, "rounded to six digits", ("    a = ", "    x = x.round(6)\n    a = ")),
)


# What follows keeps something from call to call; each is made anew where it is used.
def _two_step_in_a_closure() -> Callable:
    before: list[Any] = []

    def step(acceleration, t, x, v, dt, args):
        x_before = before[0] if before else x - dt * v
        before[:] = [np.array(x)]
        x_new = 2 * x - x_before + dt**2 * np.asarray(acceleration(t, x, v, args))
        return x_new, (x_new - x) / dt

    return step


def _stale_in_a_closure() -> Callable:
    last: list[Any] = []

    def step(acceleration, t, x, v, dt, args):
        a = last[0] if last else np.asarray(acceleration(t, x, v, args))
        x_new = x + dt * v + dt**2 / 2 * a
        a_new = np.asarray(acceleration(t + dt, x_new, v + dt * a, args))
        last[:] = [a_new]
        return x_new, v + dt / 2 * (a + a_new)

    return step


def _every_hundredth_step_left_out() -> Callable:
    calls = [0]

    def step(acceleration, t, x, v, dt, args):
        calls[0] += 1
        if calls[0] % 100 == 0:
            return np.array(x), np.array(v)
        x, v = velocity_verlet(acceleration, t, x, v, dt, args)
        return np.array(x), np.array(v)

    return step


def _mean_dt() -> Callable:
    steps: list[float] = []

    def step(acceleration, t, x, v, dt, args):
        steps.append(float(dt))
        x, v = velocity_verlet(acceleration, t, x, v, sum(steps) / len(steps), args)
        return np.array(x), np.array(v)

    return step


def _first_dt_for_good() -> Callable:
    first: list[float] = []

    def step(acceleration, t, x, v, dt, args):
        first.append(float(dt))
        x, v = velocity_verlet(acceleration, t, x, v, first[0], args)
        return np.array(x), np.array(v)

    return step


def _noise(size: float, seed: int | None) -> Callable:
    random = np.random.default_rng(seed)

    def step(acceleration, t, x, v, dt, args):
        x, v = velocity_verlet(acceleration, t, x, v, dt, args)
        return np.array(x), np.array(v) + size * random.normal(size=np.shape(v))

    return step


def _first_args_for_good() -> Callable:
    first: list[Any] = []

    def step(acceleration, t, x, v, dt, args):
        first.append(args)
        x, v = velocity_verlet(acceleration, t, x, v, dt, first[0])
        return np.array(x), np.array(v)

    return step


def _args_worn_out() -> Callable:
    def step(acceleration, t, x, v, dt, args):
        args.stiffness[:] *= 1 - 1e-3 * float(dt)
        x, v = velocity_verlet(acceleration, t, x, v, dt, args)
        return np.array(x), np.array(v)

    return step


def _euler_in_turn() -> Callable:
    calls = [0]

    def step(acceleration, t, x, v, dt, args):
        calls[0] += 1
        which = (velocity_verlet, semi_implicit_euler)[calls[0] % 2]
        x, v = which(acceleration, t, x, v, dt, args)
        return np.array(x), np.array(v)

    return step


def _kept() -> Iterator[Mutant]:
    made = {
        "two-step method in a closure": _two_step_in_a_closure,
        "acceleration kept in a closure": _stale_in_a_closure,
        "every hundredth step left out": _every_hundredth_step_left_out,
        "mean of all dt": _mean_dt,
        "first dt for good": _first_dt_for_good,
        "noise of 1e-6": lambda: _noise(1e-6, None),
        "noise of 1e-9, the same each time": lambda: _noise(1e-9, 1),
        "first args for good": _first_args_for_good,
        "wears out its args": _args_worn_out,
        "Euler every other step": _euler_in_turn,
    }
    for what, make in made.items():
        family, claims = ORIGINALS[velocity_verlet]
        yield Mutant(f"velocity_verlet: {what}", family, claims, what, make)


KEPT: tuple[Mutant, ...] = tuple(_kept())
RARE: tuple[Mutant, ...] = (*_SMALL, *_SOMEWHERE, *_SOMETIMES, *_DIGITS, *KEPT)
