"""Mutants whose symptoms are rare or small, and those that carry what a step must not."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from tests.checking.mutants.mutant import Changes, Mutant, at_end, before, by_closure, by_hand
from tests.checking.mutants.originals import (
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


def rounded(*names: str, kind: str = "float32") -> tuple[str, ...]:
    """Lines that round numbers."""
    return tuple(f"{name} = {name}.astype(np.{kind}).astype(float)" for name in names)


_RARE: dict[Callable, dict[str, Changes]] = {
    velocity_verlet: {
        "growth of 1e-3": at_end("v_new = v_new * (1 + 1e-3 * dt)"),
        "growth of 1e-6": at_end("v_new = v_new * (1 + 1e-6 * dt)"),
        "drift of 1e-3 dt^2": at_end("x_new = x_new + 1e-3 * dt**2 * x"),
        "gravity of g = 9.80665 for 9.81": before(
            "    x_new", "a = a - (1 - 9.80665 / 9.81) * args.free[:, None] * args.gravity"
        ),
        "Euler along z": at_end("x_new = x_new - np.array([0.0, 0.0, 1.0]) * dt**2 / 2 * a"),
        "Euler along x for the velocities": at_end(
            "v_new = v_new - np.array([1.0, 0.0, 0.0]) * dt / 2 * (a_new - a)"
        ),
        "Euler at the last node": at_end(
            "last = np.arange(5.0)[:, None] == 4", "x_new = x_new - last * dt**2 / 2 * a"
        ),
        "Euler next to the last node": at_end(
            "there = np.arange(5.0)[:, None] == 3", "v_new = v_new + there * dt / 2 * (a - a_new)"
        ),
        "velocities halfway": at_end("v_new = v + dt / 2 * a"),
        "velocity from the positions": at_end("v_new = (x_new - x) / dt"),
        "Euler for t > 1": at_end("x_new = x_new - (t > 1) * dt**2 / 2 * a"),
        "no force for t > 2": at_end("v_new = v_new - (t > 2) * dt / 2 * (a + a_new)"),
        "asleep where it is slow": at_end("v_new = v_new * (v_new**2 > 1e-4)"),
        **{
            f"speed limit of {limit}": at_end(
                f"v_new = v_new / (1 + (abs(v_new) > {limit}) * (abs(v_new) / {limit} - 1))"
            )
            for limit in (1, 100)
        },
        **{
            f"floor at y = -{depth}": at_end(
                f"above = (x_new > -{depth}) + (np.arange(3.0) != 1) > 0",
                f"x_new = x_new * above - {depth} * (1.0 - above)",
            )
            for depth in (1, 100)
        },
        "longest step 1/60": before("    a = ", "dt = dt - (dt > 1 / 60) * (dt - 1 / 60)"),
        "shortest step 1/60": before("    a = ", "dt = dt + (dt < 1 / 60) * (1 / 60 - dt)"),
        "always 1/60": before("    a = ", "dt = 1 / 60"),
        "time to two digits": before("    a = ", "t = np.round(float(t), 2)"),
        "float32": at_end(*rounded("x_new", "v_new")),
        "positions in float32": at_end(*rounded("x_new")),
        "forces in float32": (
            before("    x_new", *rounded("a")),
            before("    v_new", *rounded("a_new")),
        ),
    },
    semi_implicit_euler: {
        "growth of 1e-3": at_end("v_new = v_new * (1 + 1e-3 * dt)"),
        "gravity of a hundredth more": (
            "dt * a -> dt * (a + 0.01 * args.free[:, None] * args.gravity)"
        ),
        "explicit along x": at_end("x_new = x_new - np.array([1.0, 0.0, 0.0]) * dt**2 * a"),
        "explicit at odd nodes": at_end(
            "x_new = x_new - (np.arange(5.0) % 2)[:, None] * dt**2 * a"
        ),
        "flat": at_end("x_new = x_new * np.array([1.0, 1.0, 0.0])"),
        "float32": at_end(*rounded("x_new", "v_new")),
        "forces in float32": before("    v_new", *rounded("a")),
    },
    explicit_euler: {
        "growth of 1e-2": at_end("v_new = v_new * (1 + 1e-2 * dt)"),
        "gravity of a thousandth more": (
            "dt * a -> dt * (a + 0.001 * args.free[:, None] * args.gravity)"
        ),
        "float16": at_end(*rounded("x_new", "v_new", kind="float16")),
    },
    leapfrog: {
        "damping at the last node left out": at_end(
            "v_new = v_new + dt * (np.arange(5.0)[:, None] == 4) * rate * v_new"
        ),
    },
    position_verlet: {
        "x and z swapped in the last term": at_end("x_new = x_half + dt / 2 * v_new[:, ::-1]"),
    },
    rk4: {
        "growth of 1e-9": "return y -> return y * (1 + 1e-9 * dt)",
        "constant of 1e-8": "return y -> return 1e-8 * dt + y",
        "order 2 by a term of 1e-3": "2 * k3 + k4) -> 2 * k3 + k4 + 1e-3 * (k2 - k1))",
        "order 2 for t > 1": "return y -> return (t > 1) * (dt * (k2 - k4) / 6) + y",
        "order 1 for t < 0": "return y -> return (t < 0) * (dt * (k1 - k4) / 6) + y",
        "float32": before("    k1", *rounded("y")),
        "forces in float32": before("    k2", *rounded("k1")),
        "time in float32": before("    k1", "t = np.float32(float(t))"),
    },
    heun: {"dt to three digits": before("    k1", "dt = np.round(float(dt), 3)")},
    midpoint: {"time from 0": before("    k1", "t = abs(t)")},
    own_verlet: {
        "float32": before("    a = ", *rounded("x", "v")),
        "rounded to six digits": before("    a = ", "x = x.round(6)"),
    },
}


# What follows keeps something from call to call.
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


def _noise(size: float, seed: int | None) -> Callable:
    random = np.random.default_rng(seed)

    def step(acceleration, t, x, v, dt, args):
        x, v = velocity_verlet(acceleration, t, x, v, dt, args)
        return np.array(x), np.array(v) + size * random.normal(size=np.shape(v))

    return step


def _calling(choose: Callable) -> Callable[[], Callable]:
    """Calls the method with the dt and args that are chosen, by what was kept of earlier calls."""

    def make() -> Callable:
        kept: dict[str, Any] = {}

        def step(acceleration, t, x, v, dt, args):
            method, dt, args = choose(kept, float(dt), args)
            x, v = method(acceleration, t, x, v, dt, args)
            return np.array(x), np.array(v)

        return step

    return make


def _at_rest(acceleration, t, x, v, dt, args):
    return x, v


def _calls(kept):
    kept["calls"] = kept.get("calls", 0) + 1
    return kept["calls"]


def _leaving_out(kept, dt, args):
    return (velocity_verlet if _calls(kept) % 100 else _at_rest), dt, args


def _in_turn(kept, dt, args):
    return (velocity_verlet, semi_implicit_euler)[_calls(kept) % 2], dt, args


def _mean_dt(kept, dt, args):
    dts = kept.setdefault("dts", [])
    dts.append(dt)
    return velocity_verlet, sum(dts) / len(dts), args


def _first_dt(kept, dt, args):
    return velocity_verlet, kept.setdefault("dt", dt), args


def _first_args(kept, dt, args):
    return velocity_verlet, dt, kept.setdefault("args", args)


def _worn_out(kept, dt, args):
    args.stiffness[:] *= 1 - 1e-3 * dt
    return velocity_verlet, dt, args


KEPT = by_closure(
    velocity_verlet,
    {
        "two-step method in a closure": _two_step_in_a_closure,
        "acceleration kept in a closure": _stale_in_a_closure,
        "every hundredth step left out": _calling(_leaving_out),
        "mean of all dt": _calling(_mean_dt),
        "first dt for good": _calling(_first_dt),
        "noise of 1e-6": lambda: _noise(1e-6, None),
        "noise of 1e-9, the same each time": lambda: _noise(1e-9, 1),
        "first args for good": _calling(_first_args),
        "wears out its args": _calling(_worn_out),
        "Euler every other step": _calling(_in_turn),
    },
)
RARE: tuple[Mutant, ...] = (*by_hand(_RARE), *KEPT)
