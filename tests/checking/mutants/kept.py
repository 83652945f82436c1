"""Mutants that keep something from call to call: numbers of earlier steps, or arrays."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from tests.checking.mutants.mutant import Mutant
from tests.checking.mutants.originals import ORIGINALS, semi_implicit_euler, velocity_verlet


def _mutants(made: Mapping[str, Callable[[], Any]]) -> tuple[Mutant, ...]:
    """Functions that are made anew for each use."""
    original = ORIGINALS[velocity_verlet]
    return tuple(
        Mutant(f"velocity_verlet: {what}", *original, what, make) for what, make in made.items()
    )


def _keeping(own: Callable) -> Callable[[], Callable]:
    """Steps that are handed a dictionary of their own, an empty one for each use."""

    def make() -> Callable:
        kept: dict[Any, Any] = {}

        def step(acceleration, t, x, v, dt, args):
            return own(kept, acceleration, t, x, v, dt, args)

        return step

    return make


def _two_step(kept, acceleration, t, x, v, dt, args):
    before = kept.get("x", x - dt * v)
    kept["x"] = np.array(x)
    x_new = 2 * x - before + dt**2 * np.asarray(acceleration(t, x, v, args))
    return x_new, (x_new - x) / dt


def _stale(kept, acceleration, t, x, v, dt, args):
    a = kept["a"] if kept else np.asarray(acceleration(t, x, v, args))
    x_new = x + dt * v + dt**2 / 2 * a
    kept["a"] = np.asarray(acceleration(t + dt, x_new, v + dt * a, args))
    return x_new, v + dt / 2 * (a + kept["a"])


def _noise(size: float, seed: int | None) -> Callable[[], Callable]:
    def step(kept, acceleration, t, x, v, dt, args):
        random = kept.setdefault("random", np.random.default_rng(seed))
        x, v = velocity_verlet(acceleration, t, x, v, dt, args)
        return np.array(x), np.array(v) + size * random.normal(size=np.shape(v))

    return _keeping(step)


def _calling(choose: Callable) -> Callable[[], Callable]:
    """Calls the method with the dt and args that are chosen, by what was kept of earlier calls."""

    def step(kept, acceleration, t, x, v, dt, args):
        method, dt, args = choose(kept, float(dt), args)
        x, v = method(acceleration, t, x, v, dt, args)
        return np.array(x), np.array(v)

    return _keeping(step)


def _at_rest(acceleration, t, x, v, dt, args):
    return x, v


def _in_turn(*methods: Callable) -> Callable[[], Callable]:
    def choose(kept, dt, args):
        kept["calls"] = kept.get("calls", 0) + 1
        return methods[kept["calls"] % len(methods)], dt, args

    return _calling(choose)


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


KEPT = _mutants(
    {
        "two-step method in a closure": _keeping(_two_step),
        "acceleration kept in a closure": _keeping(_stale),
        "every hundredth step left out": _in_turn(_at_rest, *99 * [velocity_verlet]),
        "mean of all dt": _calling(_mean_dt),
        "first dt for good": _calling(_first_dt),
        "noise of 1e-6": _noise(1e-6, None),
        "noise of 1e-9, the same each time": _noise(1e-9, 1),
        "first args for good": _calling(_first_args),
        "wears out its args": _calling(_worn_out),
        "Euler every other step": _in_turn(velocity_verlet, semi_implicit_euler),
    }
)


def in_own_arrays(count: int) -> Callable[[], Callable]:
    def step(kept, acceleration, t, x, v, dt, args):
        own = kept.setdefault(np.shape(x), np.empty((count, 2, *np.shape(x))))
        kept["calls"] = place = (kept.get("calls", 0) + 1) % count
        own[place] = velocity_verlet(acceleration, t, x, v, dt, args)
        return own[place][0], own[place][1]

    return _keeping(step)


def last_acceleration(is_known: Callable, copy: Callable = lambda x: x) -> Callable[[], Callable]:
    """What it knows of a state from its last call; right if it keeps a copy and compares that."""

    def step(kept, acceleration, t, x, v, dt, args):
        x, v = np.asarray(x), np.asarray(v)
        known = kept and is_known(kept["x"], x)
        a = kept["a"] if known else np.array(acceleration(t, x, v, args))
        x_new = x + dt * v + dt**2 / 2 * a
        a_new = np.array(acceleration(t + dt, x_new, v + dt * a, args))
        v_new = v + dt / 2 * (a + a_new)
        kept.update(x=copy(x_new), a=np.array(acceleration(t + dt, x_new, v_new, args)))
        return x_new, v_new

    return _keeping(step)


IN_ARRAYS = _mutants(
    {
        "in one array of its own": in_own_arrays(1),
        "in two arrays of its own": in_own_arrays(2),
        "in three arrays of its own": in_own_arrays(3),
        "acceleration of the same array": last_acceleration(lambda last, x: last is x),
        "acceleration of shared memory": last_acceleration(np.shares_memory),
    }
)
