"""Mutants that are right on every check rope: they go wrong beyond a number, or on other ropes.

Speeds, lengths, forces, step sizes and times that no run of a check rope comes to; nodes that no
check rope has; and arrays that are not the step's own.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from tests.checking.mutants.mutant import Changes, Mutant, at_end, before, by_closure, by_hand
from tests.checking.mutants.originals import (
    heun,
    own_euler,
    own_verlet,
    rk4,
    semi_implicit_euler,
    velocity_verlet,
)

# RK4 with this is explicit Euler, or a method of order 2.
_EULER = "(dt * (k1 - (k1 + 2 * k2 + 2 * k3 + k4) / 6))"
_ORDER_2 = "(dt * (k2 - (k1 + 2 * k2 + 2 * k3 + k4) / 6))"
_SPEEDS = "speed = ((v_new**2).sum(1) ** 0.5)[:, None]"


def plus(term: str) -> str:
    return f"return y -> return {term} + y"


def without_new(there: str, *lines: str) -> str:
    """Velocity Verlet that takes the acceleration of the start alone for its velocities."""
    return at_end(*lines, f"v_new = v_new + {there} * dt / 2 * (a - a_new)")


def pulling(*lines: str) -> str:
    return before("        force[s] += pull", *lines)


def limited(name: str, limit: float) -> str:
    return f"{name} = {name} / (1 + (abs({name}) > {limit}) * (abs({name}) / {limit} - 1))"


_VELOCITY_VERLET: dict[str, Changes] = {
    **{
        f"put to rest below {limit:g}": at_end(f"v_new = v_new * (abs(v_new) > {limit})")
        for limit in (1e-2, 1e-3, 1e-5, 1e-6)
    },
    "nodes put to rest below 1e-3": at_end(_SPEEDS, "v_new = v_new * (speed > 1e-3)"),
    **{
        f"speed limit of {limit:g}": at_end(limited("v_new", limit))
        for limit in (50, 500, 1e4, 1e5)
    },
    "drag from 30 to 40": at_end(
        "v_new = v_new * (1 - 1e-3 * (abs(v_new) > 30) * (abs(v_new) < 40))"
    ),
    "the slowest put to rest": at_end(_SPEEDS, "v_new = v_new * (speed > 1e-4 * speed.max())"),
    **{
        f"accelerations of {limit:g} at most": before("    x_new = x +", limited("a", limit))
        for limit in (1e3, 1e6)
    },
    "slower left of x = -3000": at_end("v_new = v_new * (1 - 0.01 * (x < -3000))"),
    **{f"box of {limit:g}": at_end(limited("x_new", limit)) for limit in (1e3, 1e4, 1e6)},
    "a hundredth more force for dt from 0.013 to 0.015": at_end(
        "v_new = v_new + (dt > 0.013) * (dt < 0.015) * dt * a / 100"
    ),
    "Euler for dt < 1e-3": without_new("(dt < 1e-3)"),
    "dt of 1 at most": before("    a = ", "dt = dt - (dt > 1) * (dt - 1)"),
    "dt of 1e-6 at least": before("    a = ", "dt = dt + (dt < 1e-6) * (1e-6 - dt)"),
    "no force for t > 10": at_end("v_new = v_new - (t > 10) * dt / 2 * (a + a_new)"),
    "Euler where it is fast and dt < 0.005": without_new("(abs(v) > 20) * (dt < 0.005)"),
    "Euler where it is fast and late": without_new("(abs(v) > 20) * (t > 50)"),
    "Euler where it is slow and dt > 5": without_new("(abs(v) < 0.01) * (dt > 5)"),
    **{
        f"Euler at node {node}": without_new(f"(np.arange(len(x)) == {node})[:, None]")
        for node in (5, 7, 11, 20, 32)
    },
    "Euler at the last node of long ropes": without_new(
        "(np.arange(len(x)) == len(x) - 2)[:, None] * (len(x) > 12)"
    ),
    "Euler in the middle of long ropes": without_new(
        "(np.arange(len(x)) == len(x) // 2 + 1)[:, None] * (len(x) > 32)"
    ),
    "Euler for eight nodes": without_new("(len(x) == 8)"),
    "Euler for multiples of four nodes": without_new("(len(x) % 4 == 0)"),
    "Euler for more than 64 nodes": without_new("(len(x) > 64)"),
    "Euler for two nodes": without_new("(len(x) < 3)"),
}

_RK4: dict[str, Changes] = {
    "Euler where it is fast": plus(f"(abs(y) > 1e4).any() * {_EULER}"),
    **{
        f"Euler for dt < {dt:g}": plus(f"(dt < {dt}) * {_EULER}") for dt in (1e-2, 1e-3, 1e-5, 1e-6)
    },
    **{f"Euler for dt > {dt:g}": plus(f"(dt > {dt}) * {_EULER}") for dt in (0.5, 1.0, 10.0)},
    "order 2 for dt < 1e-4": plus(f"(dt < 1e-4) * {_ORDER_2}"),
    "order 2 for dt from 1e-4 to 1e-2": plus(f"(dt > 1e-4) * (dt < 1e-2) * {_ORDER_2}"),
    "Euler for dt from 3e-4 to 6e-4": plus(f"(dt > 3e-4) * (dt < 6e-4) * {_EULER}"),
    **{f"Euler for t > {t}": plus(f"(t > {t}) * {_EULER}") for t in (10, 100, 5000)},
    "Euler for t from 37 to 41": plus(f"(t > 37) * (t < 41) * {_EULER}"),
    **{f"order 2 for t < -{t}": plus(f"(t < -{t}) * {_ORDER_2}") for t in (10, 1000)},
}

_SEMI_IMPLICIT: dict[str, Changes] = {
    "friction below 1e-4": at_end("v_new = v_new * (1 - 0.5 * (abs(v_new) < 1e-4))"),
    "drag above 1000": at_end("v_new = v_new * (1 - 0.01 * (abs(v_new) > 1000))"),
    **{
        f"floor at y = -{depth:g}": at_end(
            f"above = (x_new > -{depth}) + (np.arange(x.shape[1]) != 1) > 0",
            f"x_new = x_new * above - {depth} * (1.0 - above)",
        )
        for depth in (1e3, 1e5)
    },
    "at rest for t > 1e5": at_end("v_new = v_new * (t < 1e5)"),
}

_OWN_VERLET: dict[str, Changes] = {
    **{
        f"pulls of {limit:g} at most": pulling(f"pull = pull.clip(-{limit}, {limit})")
        for limit in (1e2, 1e4, 1e7)
    },
    **{
        f"no pulls below {limit:g}": pulling(f"pull = pull * (abs(pull) > {limit})")
        for limit in (1e-3, 1e-6, 1e-8)
    },
    "masses of 100 at most": "free[i] / args.mass[i] -> free[i] / min(args.mass[i], 100.0)",
    **{
        f"springs cut beyond {ratio} rest lengths": pulling(
            f"pull = pull * (length < {ratio} * args.rest_length[s])"
        )
        for ratio in (3, 5, 10, 30)
    },
    **{
        what: pulling("rest = args.rest_length[s]", f"pull = pull * ({pulls})")
        for what, pulls in (
            ("springs cut below a twentieth of the rest length", "length > 0.05 * rest"),
            ("springs slack next to their rest lengths", "abs(length - rest) > 1e-3 * rest"),
            ("springs without a rest length left out", "rest > 1e-9"),
            ("springs cut that are seventy times too short", "rest < 70 * length"),
        )
    },
    "heavy and fast nodes drag": before(
        "        force[i] *= ", "force[i] -= (args.mass[i] > 5) * (abs(v[i]) > 2) * v[i]"
    ),
    "no more than four springs": "s in range(nodes - 1) -> s in range(min(nodes - 1, 4))",
    "no more than sixteen springs": "s in range(nodes - 1) -> s in range(min(nodes - 1, 16))",
    "the first pin only": (
        "*= args.free[i] -> *= (i != list(args.free).index(0) if 0 in args.free else 1)"
    ),
    "gravity along the second axis in a plane": (
        "return force -> return force * (1 + 0.1 * (len(args.gravity) == 2))"
    ),
}

_OWN_EULER: dict[str, Changes] = {
    "no springs below a stiffness of 1e-3": pulling("pull = pull * (args.stiffness[s] > 1e-3)"),
    "springs cut below a fifth of the rest length": pulling(
        "pull = pull * (length > 0.2 * args.rest_length[s])"
    ),
    "harder beyond four rest lengths": pulling(
        "pull = pull * (1 + 0.1 * (length > 4 * args.rest_length[s]))"
    ),
    "no more than five masses": "args.mass[i] * args -> args.mass[min(i, 4)] * args",
    "the last pin only": (
        before(
            "        force[i] *= ",
            "last = max((k for k in range(nodes) if args.free[k] == 0), default=-1)",
        ),
        "*= args.free[i] -> *= (i != last)",
    ),
}


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


THRESHOLDS: tuple[Mutant, ...] = (
    *by_hand(
        {
            velocity_verlet: _VELOCITY_VERLET,
            rk4: _RK4,
            heun: {"nothing for dt < 1e-7": before("    k1", "dt = dt * (dt > 1e-7)")},
            semi_implicit_euler: _SEMI_IMPLICIT,
            own_verlet: _OWN_VERLET,
            own_euler: _OWN_EULER,
        }
    ),
    *by_closure(
        velocity_verlet,
        {
            "in one array of its own": _in_own_arrays(1),
            "in two arrays of its own": _in_own_arrays(2),
            "in three arrays of its own": _in_own_arrays(3),
            "acceleration of the same array": _last_acceleration(lambda last, x: last is x),
            "acceleration of shared memory": _last_acceleration(np.shares_memory),
        },
    ),
)
