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
        "two-step method in a closure": _two_step_in_a_closure,
        "acceleration kept in a closure": _stale_in_a_closure,
        "every hundredth step left out": _in_turn(_at_rest, *99 * [velocity_verlet]),
        "mean of all dt": _calling(_mean_dt),
        "first dt for good": _calling(_first_dt),
        "noise of 1e-6": lambda: _noise(1e-6, None),
        "noise of 1e-9, the same each time": lambda: _noise(1e-9, 1),
        "first args for good": _calling(_first_args),
        "wears out its args": _calling(_worn_out),
        "Euler every other step": _in_turn(velocity_verlet, semi_implicit_euler),
    }
)


def _in_own_arrays(count: int) -> Callable[[], Any]:
    def make() -> Any:
        arrays: dict[Any, Any] = {}
        calls = [0]

        def step(acceleration, t, x, v, dt, args):
            own = arrays.setdefault(np.shape(x), np.empty((count, 2, *np.shape(x))))
            calls[0] = (calls[0] + 1) % count
            own[calls[0]] = velocity_verlet(acceleration, t, x, v, dt, args)
            return own[calls[0]][0], own[calls[0]][1]

        return step

    return make


def _last_acceleration(is_known: Callable[[Any, Any], bool]) -> Callable[[], Any]:
    def make() -> Any:
        last: dict[str, Any] = {}

        def step(acceleration, t, x, v, dt, args):
            x, v = np.asarray(x), np.asarray(v)
            known = "x" in last and is_known(last["x"], x)
            a = last["a"] if known else np.array(acceleration(t, x, v, args))
            x_new = x + dt * v + dt**2 / 2 * a
            a_new = np.array(acceleration(t + dt, x_new, v + dt * a, args))
            v_new = v + dt / 2 * (a + a_new)
            last.update(x=x_new, a=np.array(acceleration(t + dt, x_new, v_new, args)))
            return x_new, v_new

        return step

    return make


IN_ARRAYS = _mutants(
    {
        "in one array of its own": _in_own_arrays(1),
        "in two arrays of its own": _in_own_arrays(2),
        "in three arrays of its own": _in_own_arrays(3),
        "acceleration of the same array": _last_acceleration(lambda last, x: last is x),
        "acceleration of shared memory": _last_acceleration(np.shares_memory),
    }
)
