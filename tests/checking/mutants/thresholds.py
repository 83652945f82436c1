"""Mutants that are right on every check rope: they go wrong beyond a number, or on other ropes.

Speeds, lengths, forces, step sizes and times that no run of a check rope comes to; nodes that no
check rope has; and arrays that are not the step's own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from tests.checking.mutants.mutant import Mutant, replaced
from tests.checking.mutants.originals import (
    ORIGINALS,
    heun,
    own_euler,
    own_verlet,
    rk4,
    semi_implicit_euler,
    velocity_verlet,
)

_END = "    return x_new, v_new"
_PULL = "        force[s] += pull"


def _at_end(original: Callable, what: str, *lines: str) -> Mutant:
    return replaced(original, what, (_END, "".join(f"    {line}\n" for line in lines) + _END))


def _at_rk4_end(what: str, wrong: str) -> Mutant:
    right = "    return y + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)"
    return replaced(rk4, what, (right, f"    wrong = {wrong}\n{right} + wrong"))


# RK4 minus this is explicit Euler, or a method of order 2.
_EULER = "(dt * (k1 - (k1 + 2 * k2 + 2 * k3 + k4) / 6))"
_ORDER_2 = "(dt * (k2 - (k1 + 2 * k2 + 2 * k3 + k4) / 6))"


def _of_speed() -> Iterator[Mutant]:
    for limit in (1e-2, 1e-3, 1e-5, 1e-6):
        what = f"put to rest below {limit:g}"
        yield _at_end(velocity_verlet, what, f"v_new = v_new * (abs(v_new) > {limit})")
    yield _at_end(
        velocity_verlet,
        "nodes put to rest below 1e-3",
        "speed = ((v_new**2).sum(1) ** 0.5)[:, None]",
        "v_new = v_new * (speed > 1e-3)",
    )
    yield _at_end(
        semi_implicit_euler,
        "friction below 1e-4",
        "v_new = v_new * (1 - 0.5 * (abs(v_new) < 1e-4))",
    )
    for limit in (50, 500, 1e4, 1e5):
        yield _at_end(
            velocity_verlet,
            f"speed limit of {limit:g}",
            f"v_new = v_new / (1 + (abs(v_new) > {limit}) * (abs(v_new) / {limit} - 1))",
        )
    yield _at_end(
        semi_implicit_euler, "drag above 1000", "v_new = v_new * (1 - 0.01 * (abs(v_new) > 1000))"
    )
    yield _at_rk4_end("Euler where it is fast", f"(abs(y) > 1e4).any() * {_EULER}")
    yield _at_end(
        velocity_verlet,
        "drag from 30 to 40",
        "v_new = v_new * (1 - 1e-3 * (abs(v_new) > 30) * (abs(v_new) < 40))",
    )
    yield _at_end(
        velocity_verlet,
        "the slowest put to rest",
        "speed = ((v_new**2).sum(1) ** 0.5)[:, None]",
        "v_new = v_new * (speed > 1e-4 * speed.max())",
    )


def _of_force() -> Iterator[Mutant]:
    for limit in (1e3, 1e6):
        yield replaced(
            velocity_verlet,
            f"accelerations of {limit:g} at most",
            (
                "    x_new = x +",
                f"    a = a / (1 + (abs(a) > {limit}) * (abs(a) / {limit} - 1))\n    x_new = x +",
            ),
        )
    for limit in (1e2, 1e4, 1e7):
        yield replaced(
            own_verlet,
            f"pulls of {limit:g} at most",
            (
                "        force[s] += pull",
                f"        pull = pull.clip(-{limit}, {limit})\n        force[s] += pull",
            ),
        )
    for limit in (1e-3, 1e-6, 1e-8):
        yield replaced(
            own_verlet,
            f"no pulls below {limit:g}",
            (
                "        force[s] += pull",
                f"        pull = pull * (abs(pull) > {limit})\n        force[s] += pull",
            ),
        )
    yield replaced(
        own_euler,
        "no springs below a stiffness of 1e-3",
        (
            "        force[s] += pull",
            "        pull = pull * (args.stiffness[s] > 1e-3)\n        force[s] += pull",
        ),
    )
    yield replaced(
        own_verlet,
        "masses of 100 at most",
        ("args.free[i] / args.mass[i]", "args.free[i] / min(args.mass[i], 100.0)"),
    )


def _of_length() -> Iterator[Mutant]:
    for ratio in (3, 5, 10, 30):
        yield replaced(
            own_verlet,
            f"springs cut beyond {ratio} rest lengths",
            (
                _PULL,
                f"        pull = pull * (length < {ratio} * args.rest_length[s])\n{_PULL}",
            ),
        )
    yield replaced(
        own_euler,
        "springs cut below a fifth of the rest length",
        (
            _PULL,
            f"        pull = pull * (length > 0.2 * args.rest_length[s])\n{_PULL}",
        ),
    )
    yield replaced(
        own_euler,
        "harder beyond four rest lengths",
        (
            _PULL,
            f"        pull = pull * (1 + 0.1 * (length > 4 * args.rest_length[s]))\n{_PULL}",
        ),
    )
    for what, pulls in (
        ("springs cut below a twentieth of the rest length", "length > 0.05 * rest"),
        ("springs slack next to their rest lengths", "abs(length - rest) > 1e-3 * rest"),
        ("springs without a rest length left out", "rest > 1e-9"),
        ("springs cut that are seventy times too short", "rest < 70 * length"),
    ):
        changed = f"        rest = args.rest_length[s]\n        pull = pull * ({pulls})\n{_PULL}"
        yield replaced(own_verlet, what, (_PULL, changed))
    yield _at_end(
        velocity_verlet, "slower left of x = -3000", "v_new = v_new * (1 - 0.01 * (x < -3000))"
    )
    for limit in (1e3, 1e4, 1e6):
        yield _at_end(
            velocity_verlet,
            f"box of {limit:g}",
            f"x_new = x_new / (1 + (abs(x_new) > {limit}) * (abs(x_new) / {limit} - 1))",
        )
    for floor in (1e3, 1e5):
        yield _at_end(
            semi_implicit_euler,
            f"floor at y = -{floor:g}",
            f"above = (x_new > -{floor}) + (np.arange(x.shape[1]) != 1) > 0",
            f"x_new = x_new * above - {floor} * (1.0 - above)",
        )


def _of_dt() -> Iterator[Mutant]:
    for limit in (1e-2, 1e-3, 1e-5, 1e-6):
        yield _at_rk4_end(f"Euler for dt < {limit:g}", f"(dt < {limit}) * {_EULER}")
    for limit in (0.5, 1.0, 10.0):
        yield _at_rk4_end(f"Euler for dt > {limit:g}", f"(dt > {limit}) * {_EULER}")
    yield _at_rk4_end("order 2 for dt < 1e-4", f"(dt < 1e-4) * {_ORDER_2}")
    yield _at_rk4_end("order 2 for dt from 1e-4 to 1e-2", f"(dt > 1e-4) * (dt < 1e-2) * {_ORDER_2}")
    yield _at_rk4_end("Euler for dt from 3e-4 to 6e-4", f"(dt > 3e-4) * (dt < 6e-4) * {_EULER}")
    yield _at_end(
        velocity_verlet,
        "a hundredth more force for dt from 0.013 to 0.015",
        "v_new = v_new + (dt > 0.013) * (dt < 0.015) * dt * a / 100",
    )
    yield _at_end(
        velocity_verlet, "Euler for dt < 1e-3", "v_new = v_new + (dt < 1e-3) * dt * (a - a_new) / 2"
    )
    yield replaced(heun, "nothing for dt < 1e-7", ("    k1", "    dt = dt * (dt > 1e-7)\n    k1"))
    yield replaced(
        velocity_verlet,
        "dt of 1 at most",
        ("    a = ", "    dt = dt - (dt > 1) * (dt - 1)\n    a = "),
    )
    yield replaced(
        velocity_verlet,
        "dt of 1e-6 at least",
        ("    a = ", "    dt = dt + (dt < 1e-6) * (1e-6 - dt)\n    a = "),
    )


def _of_time() -> Iterator[Mutant]:
    for limit in (10, 100, 5000):
        yield _at_rk4_end(f"Euler for t > {limit}", f"(t > {limit}) * {_EULER}")
    yield _at_rk4_end("Euler for t from 37 to 41", f"(t > 37) * (t < 41) * {_EULER}")
    yield _at_rk4_end("order 2 for t < -10", f"(t < -10) * {_ORDER_2}")
    yield _at_rk4_end("order 2 for t < -1000", f"(t < -1000) * {_ORDER_2}")
    yield _at_end(
        velocity_verlet, "no force for t > 10", "v_new = v_new - (t > 10) * dt / 2 * (a + a_new)"
    )
    yield _at_end(semi_implicit_euler, "at rest for t > 1e5", "v_new = v_new * (t < 1e5)")


def _of_two() -> Iterator[Mutant]:
    for what, there in (
        ("Euler where it is fast and dt < 0.005", "(abs(v) > 20) * (dt < 0.005)"),
        ("Euler where it is fast and late", "(abs(v) > 20) * (t > 50)"),
        ("Euler where it is slow and dt > 5", "(abs(v) < 0.01) * (dt > 5)"),
    ):
        yield _at_end(velocity_verlet, what, f"v_new = v_new + {there} * dt / 2 * (a - a_new)")
    yield replaced(
        own_verlet,
        "heavy and fast nodes drag",
        (
            "        force[i] *= ",
            "        force[i] -= (args.mass[i] > 5) * (abs(v[i]) > 2) * v[i]\n        force[i] *= ",
        ),
    )


def _of_nodes() -> Iterator[Mutant]:
    for node in (5, 7, 11, 20, 32):
        yield _at_end(
            velocity_verlet,
            f"Euler at node {node}",
            f"there = (np.arange(len(x)) == {node})[:, None]",
            "v_new = v_new + there * dt / 2 * (a - a_new)",
        )
    yield _at_end(
        velocity_verlet,
        "Euler at the last node of long ropes",
        "there = (np.arange(len(x)) == len(x) - 2)[:, None] * (len(x) > 12)",
        "v_new = v_new + there * dt / 2 * (a - a_new)",
    )
    yield _at_end(
        velocity_verlet,
        "Euler in the middle of long ropes",
        "there = (np.arange(len(x)) == len(x) // 2 + 1)[:, None] * (len(x) > 32)",
        "v_new = v_new + there * dt / 2 * (a - a_new)",
    )
    for what, there in (
        ("eight nodes", "len(x) == 8"),
        ("multiples of four nodes", "len(x) % 4 == 0"),
        ("more than 64 nodes", "len(x) > 64"),
    ):
        yield _at_end(
            velocity_verlet,
            f"Euler for {what}",
            f"v_new = v_new + ({there}) * dt / 2 * (a - a_new)",
        )
    yield _at_end(
        velocity_verlet,
        "Euler for two nodes",
        "v_new = v_new + (len(x) < 3) * dt / 2 * (a - a_new)",
    )
    yield replaced(
        own_verlet,
        "no more than four springs",
        ("    for s in range(nodes - 1):", "    for s in range(min(nodes - 1, 4)):"),
    )
    yield replaced(
        own_verlet,
        "no more than sixteen springs",
        ("    for s in range(nodes - 1):", "    for s in range(min(nodes - 1, 16)):"),
    )
    yield replaced(
        own_euler,
        "no more than five masses",
        (
            "        force[i] += args.mass[i] * args.gravity",
            "        force[i] += args.mass[min(i, 4)] * args.gravity",
        ),
    )
    yield replaced(
        own_verlet,
        "the first pin only",
        (
            "        force[i] *= args.free[i] / args.mass[i]",
            "        force[i] *= (i != list(args.free).index(0) if 0 in args.free else 1)"
            " / args.mass[i]",
        ),
    )
    yield replaced(
        own_euler,
        "the last pin only",
        (
            "        force[i] *= args.free[i] / args.mass[i]",
            "        last = max((k for k in range(nodes) if args.free[k] == 0), default=-1)\n"
            "        force[i] *= (i != last) / args.mass[i]",
        ),
    )
    yield replaced(
        own_verlet,
        "gravity along the second axis in a plane",
        ("    return force", "    return force * (1 + 0.1 * (len(args.gravity) == 2))"),
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


def _of_arrays() -> Iterator[Mutant]:
    made = {
        "in one array of its own": _in_own_arrays(1),
        "in two arrays of its own": _in_own_arrays(2),
        "in three arrays of its own": _in_own_arrays(3),
        "acceleration of the same array": _last_acceleration(lambda last, x: last is x),
        "acceleration of shared memory": _last_acceleration(np.shares_memory),
    }
    for what, make in made.items():
        family, claims = ORIGINALS[velocity_verlet]
        yield Mutant(f"velocity_verlet: {what}", family, claims, what, make)


THRESHOLDS: tuple[Mutant, ...] = (
    *_of_speed(),
    *_of_force(),
    *_of_length(),
    *_of_dt(),
    *_of_time(),
    *_of_two(),
    *_of_nodes(),
    *_of_arrays(),
)
