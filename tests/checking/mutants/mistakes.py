"""Mistakes that people make, each as a change of a right stepper's text."""

from __future__ import annotations

from collections.abc import Callable

from tests.checking.mutants.mutant import Changes, Mutant, before, by_hand
from tests.checking.mutants.originals import (
    StormerVerlet,
    explicit_euler,
    heun,
    leapfrog,
    midpoint,
    own_euler,
    own_verlet,
    position_verlet,
    rk4,
    rk4_apart,
    semi_implicit_euler,
    velocity_verlet,
)

_NEXT = "(2 * now - (1 - half) * before + dt**2 * a) / (1 + half)"
_PULL = "        force[s] += pull"

_TABLE: dict[Callable, dict[str, Changes]] = {
    explicit_euler: {
        "dt missing": "x + dt * v -> x + v",
        "dt squared": "v + dt * a -> v + dt**2 * a",
        "force at the end": "acceleration(t, -> acceleration(t + 100 * dt,",
        "half a step": "x + dt * v -> x + dt / 2 * v",
        "velocity overwritten": "v_new = v + dt * a -> v_new = dt * a",
        "position from the origin": "x_new = x + -> x_new =",
        "damped once more, each step": "v_new = v + dt * a -> v_new = 0.999 * (v + dt * a)",
    },
    semi_implicit_euler: {
        "force of the next positions": "(t, x, v, args) -> (t, x + v, v, args)",
        "sign of the velocity": "x + dt * v_new -> x - dt * v_new",
        "mean velocity twice": "x + dt * v_new -> x + dt * (v + v_new)",
        "damping per step": (
            "v_new = v + dt * a -> v_new = (1 - args.damping[:, None]) * v + dt * "
            "(a + (args.free * args.damping / args.mass)[:, None] * v)"
        ),
        "damping sign": (
            "dt * a -> dt * (a + 2 * (args.free * args.damping / args.mass)[:, None] * v)"
        ),
        "no damping": "acceleration(t, x, v, args) -> acceleration(t, x, 0 * v, args)",
        "damping without mass": (
            "dt * a -> dt * (a + (args.free * args.damping * (1 / args.mass - 1))[:, None] * v)"
        ),
        "gravity twice": "v + dt * a -> v + dt * (a + args.free[:, None] * args.gravity)",
        "pinned nodes fall": "v + dt * a -> v + dt * (a + (1 - args.free[:, None]) * args.gravity)",
        "time stands still": "acceleration(t, x -> acceleration(0.0, x",
    },
    velocity_verlet: {
        "half missing": "dt**2 / 2 * a -> dt**2 * a",
        "dt once": "dt**2 / 2 * a -> dt / 2 * a",
        "dt cubed": "dt**2 / 2 * a -> dt**3 / 2 * a",
        "no second-order term": " + dt**2 / 2 * a -> ",
        "stale acceleration": "(a + a_new) -> (a + a)",
        "new acceleration twice": "(a + a_new) -> (a_new + a_new)",
        "half missing in the velocity": "v + dt / 2 * -> v + dt *",
        "forces at old positions": "acceleration(t + dt, x_new, -> acceleration(t + dt, x,",
        "old time": "acceleration(t + dt, x_new, -> acceleration(t, x_new,",
        "half time": "acceleration(t + dt, x_new, -> acceleration(t + dt / 2, x_new,",
        "lagged damping": "x_new, v_guess, args -> x_new, v, args",
        "damping at the end only": "acceleration(t, x, v, args) -> acceleration(t, x, 0 * v, args)",
        "velocity before position": (
            "x_new = x + dt * v + dt**2 / 2 * a\n    v_guess = v + dt * a"
            " -> v_guess = v + dt * a\n    x_new = x + dt * v_guess + dt**2 / 2 * a"
        ),
        "damping per step": before(
            "    return", "v_new = (1 - 0.1 * args.damping[:, None]) * v_new"
        ),
    },
    leapfrog: {
        "whole kick first": "v + dt / 2 * a\n -> v + dt * a\n",
        "two first kicks": "dt / 2 * a_new -> dt / 2 * a",
        "no second kick": "(v_half + dt / 2 * a_new) -> v_half",
        "old velocity drifts": "x + dt * v_half -> x + dt * v",
        "half a drift": "x + dt * v_half -> x + dt / 2 * v_half",
        "damping all explicit": (
            "(1 - rate * dt / 2) -> (1 - rate * dt)",
            " / (1 + rate * dt / 2) -> ",
        ),
        "damping all implicit": (
            "(1 - rate * dt / 2) * v -> v",
            "(1 + rate * dt / 2) -> (1 + rate * dt)",
        ),
        "damping twice": (
            "rate * dt / 2) * v -> rate * dt) * v",
            "(1 + rate * dt / 2) -> (1 + rate * dt)",
        ),
        "no damping": "args.free * args.damping -> 0 * args.damping",
        "damping per step": "args.damping / args.mass)[:, None] -> args.damping)[:, None] / dt",
        "damping without mass": "args.damping / args.mass -> args.damping",
        "old time": "acceleration(t + dt, -> acceleration(t,",
        "mean mass": "args.damping / args.mass -> args.damping / args.mass.mean()",
        "mean damping": "args.damping / args.mass -> args.damping.mean() / args.mass",
    },
    position_verlet: {
        "force at the start": "t + dt / 2, x_half -> t + dt / 2, x",
        "time of the start": "acceleration(t + dt / 2, -> acceleration(t,",
        "time of the end": "acceleration(t + dt / 2, -> acceleration(t + dt,",
        "whole first drift": "x_half = x + dt / 2 * v -> x_half = x + dt * v",
        "old velocity drifts": "dt / 2 * v_new -> dt / 2 * v",
        "half a kick": "+ dt * a_half -> + dt / 2 * a_half",
        "no damping": "args.free * args.damping -> 0 * args.damping",
    },
    StormerVerlet: {
        "starts from rest": "y.x - dt * y.v + dt**2 / 2 * a -> y.x",
        "starts without acceleration": "- dt * y.v + dt**2 / 2 * a -> - dt * y.v",
        "starts forward": "y.x - dt * y.v -> y.x + dt * y.v",
        "starts without the half": "dt**2 / 2 * a -> dt**2 * a",
        "starts with the wrong sign": "+ dt**2 / 2 * a -> - dt**2 / 2 * a",
        "lagged damping": f"{_NEXT} -> now + (1 - 2 * half) * (now - before) + dt**2 * a",
        "damping per step": (
            f"{_NEXT} -> now + (1 - system.damping.coefficient) * (now - before) + dt**2 * a"
        ),
        "no damping": "half = system.damping.rate * dt / 2 -> half = 0.0",
        "dt once": "before + dt**2 * a -> before + dt * a",
        "half the force": "before + dt**2 * a -> before + dt**2 / 2 * a",
        "velocity from behind": "(after - carried -> 2 * (carried.now - carried",
        "velocity from ahead": "carried.before) / (2 * dt) -> carried.now) / dt",
        "velocity twice": "carried.before) / (2 * dt) -> carried.before) / dt",
        "time of the last step": "(t, now) -> (t - dt, now)",
        "samples one step ahead": "Phase(carried.now, v) -> Phase(after, v)",
        "samples one step behind": "Phase(carried.now, v) -> Phase(carried.before, v)",
        "forces at old positions": "(t, now) -> (t, before)",
    },
    heun: {
        "second stage at t": "rhs(t + dt, -> rhs(t,",
        "second stage at half time": "rhs(t + dt, -> rhs(t + dt / 2,",
        "half the slope": "y + dt * k1 -> y + dt / 2 * k1",
        "half missing": "y + dt / 2 * (k1 + k2) -> y + dt * (k1 + k2)",
        "first slope only": "(k1 + k2) -> (k1 + k1)",
        "second slope only": "(k1 + k2) -> (k2 + k2)",
    },
    midpoint: {
        "first slope only": "y + dt * k2 -> y + dt * k1",
        "at t": "rhs(t + dt / 2, -> rhs(t,",
        "at the end": "rhs(t + dt / 2, -> rhs(t + dt,",
        "whole slope": "y + dt / 2 * k1 -> y + dt * k1",
        "half the step": "y + dt * k2 -> y + dt / 2 * k2",
    },
    rk4: {
        "all stages at t": (
            "k2 = rhs(t + dt / 2, -> k2 = rhs(t,",
            "k3 = rhs(t + dt / 2, -> k3 = rhs(t,",
            "rhs(t + dt, -> rhs(t,",
        ),
        "second stage at t + dt": "k2 = rhs(t + dt / 2, -> k2 = rhs(t + dt,",
        "third stage at t": "k3 = rhs(t + dt / 2, -> k3 = rhs(t,",
        "last stage at half time": "rhs(t + dt, -> rhs(t + dt / 2,",
        "third stage from the first": "dt / 2 * k2 -> dt / 2 * k1",
        "last stage from the second": "dt * k3 -> dt * k2",
        "last stage with half a step": "y + dt * k3 -> y + dt / 2 * k3",
        "second stage with a whole step": "y + dt / 2 * k1 -> y + dt * k1",
        "stages from each other": "y + dt / 2 * k2 -> y + dt / 2 * (k1 + k2)",
        "weights 1 2 2 2": "2 * k3 + k4 -> 2 * k3 + 2 * k4",
        "weights 1 2 1 1": "2 * k3 + k4 -> k3 + k4",
        "weights 2 1 1 2": "k1 + 2 * k2 + 2 * k3 + k4 -> 2 * k1 + k2 + k3 + 2 * k4",
        "weights 1 3 3 1 over 8": "6 * (k1 + 2 * k2 + 2 * k3 -> 8 * (k1 + 3 * k2 + 3 * k3",
        "weights equal": "dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4) -> dt / 4 * (k1 + k2 + k3 + k4)",
        "weights 1 4 1": "(k1 + 2 * k2 + 2 * k3 + k4) -> (k1 + 4 * k2 + k4)",
        "weights forgotten": "(k1 + 2 * k2 + 2 * k3 + k4) -> (k1 + k2 + k3 + k4)",
        "last slope counts twice": "2 * k3 + k4 -> 2 * k3 + k3",
        "dt / 8": "dt / 6 -> dt / 8",
    },
    rk4_apart: {
        "positions by Euler": "dt / 6 * (v1 + 2 * v2 + 2 * v3 + v4) -> dt * v1",
        "positions by the new velocity": (
            "dt / 6 * (v1 + 2 * v2 + 2 * v3 + v4)"
            " -> dt * (v + dt / 6 * (a1 + 2 * a2 + 2 * a3 + a4))"
        ),
        "forces frozen": "x3, v3, args -> x2, v2, args",
        "positions of the stages frozen": (
            "x2, v2, args -> x, v2, args",
            "x3, v3, args -> x, v3, args",
            "x4, v4, args -> x, v4, args",
        ),
        "velocities of the stages frozen": (
            "x2, v2, args -> x2, v, args",
            "x3, v3, args -> x3, v, args",
            "x4, v4, args -> x4, v, args",
        ),
        "third position from the first slope": "x + dt / 2 * v2 -> x + dt / 2 * v1",
    },
    own_euler: {
        "force sign": (
            "force[s] += pull -> force[s] -= pull",
            "force[s + 1] -= pull -> force[s + 1] += pull",
        ),
        "one-ended spring": "        force[s + 1] -= pull\n -> ",
        "other end pulled the same way": "force[s + 1] -= pull -> force[s + 1] += pull",
        "gravity times mass twice": "args.mass[i] * args -> args.mass[i] ** 2 * args",
        "gravity without mass": "args.mass[i] * args.gravity -> args.gravity",
        "gravity set and not added": "+= args.mass[i] * args.gravity -> = args.gravity",
        "no gravity": "        force[i] += args.mass[i] * args.gravity\n -> ",
        "gravity along y only": "args.gravity -> args.gravity * np.array([0.0, 1.0, 0.0])",
        "missing mass": "args.free[i] / args.mass[i] -> args.free[i]",
        "mass times force": "args.free[i] / args.mass[i] -> args.free[i] * args.mass[i]",
        "mass of the first node": "args.free[i] / args.mass[i] -> args.free[i] / args.mass[0]",
        "integer rest length": "- args.rest_length[s]) -> - int(args.rest_length[s]))",
        "rounded rest length": "- args.rest_length[s]) -> - round(args.rest_length[s]))",
        "rest length 1": "- args.rest_length[s]) -> - 1.0)",
        "no rest length": "(length - args.rest_length[s]) -> length",
        "rest length of the first spring": "args.rest_length[s] -> args.rest_length[0]",
        "stiffness of the first spring": "args.stiffness[s] -> args.stiffness[0]",
        "stiffness per length": "args.stiffness[s] -> args.stiffness[s] / args.rest_length[s]",
        "force not by direction": "* d / length -> * d",
        "length by taxi": "np.sqrt(d @ d) -> np.sum(np.abs(d))",
        "length in the plane": "np.sqrt(d @ d) -> np.sqrt(d[:2] @ d[:2])",
        "no force along z": "* d / length -> * d * np.array([1.0, 1.0, 0.0]) / length",
        "springs only pull": before(_PULL, "pull = pull * (length > args.rest_length[s])"),
        "last spring missing": "range(nodes - 1) -> range(nodes - 2)",
        "first spring missing": "range(nodes - 1) -> range(1, nodes - 1)",
        "last node without gravity": (
            "(nodes):\n        force[i] += -> (nodes - 1):\n        force[i] +="
        ),
        "pinned node moved": "*= args.free[i] / args.mass[i] -> /= args.mass[i]",
        "only the first node pinned": "*= args.free[i] / args.mass[i] -> *= (i > 0) / args.mass[i]",
        "first node always pinned": "args.free[i] / args -> (i > 0) * args.free[i] / args",
        "damping sign": "force[i] -= args.damping -> force[i] += args.damping",
        "no damping": "        force[i] -= args.damping[i] * v[i]\n -> ",
        "damping by mass": "args.damping[i] * v[i] -> args.damping[i] * args.mass[i] * v[i]",
        "damping of the first node": "args.damping[i] * v[i] -> args.damping[0] * v[i]",
        "damping of the speed along the spring only": (
            "        force[i] -= args.damping[i] * v[i]\n -> ",
            before(
                _PULL,
                "u = d / length",
                "pull = pull + args.damping[s] * ((v[s + 1] - v[s]) @ u) * u",
            ),
        ),
        "missing force reset": (
            "def own_forces( -> FORCE = np.zeros((5, 3))\n\ndef own_forces(",
            "force = np.zeros_like(x) -> force = FORCE",
        ),
        "positions updated node by node, forces computed between": (
            "v_new = v + dt * own_forces(x, v, args)\n    return x + dt * v_new, v_new"
            " -> x, v = x.copy(), v.copy()\n    for i in range(len(x)):\n"
            "        v[i] = v[i] + dt * own_forces(x, v, args)[i]\n"
            "        x[i] = x[i] + dt * v[i]\n    return x, v"
        ),
        "division by a length of zero": "        if length == 0:\n            continue\n -> ",
    },
    own_verlet: {
        "stale acceleration": "(a + a_new) -> (a + a)",
        "forces at old positions": "own_forces(x_new, -> own_forces(x,",
        "lagged damping": "v + dt * a, args -> v, args",
        "positions updated node by node, forces computed between": (
            "a_new = own_forces(x_new, v + dt * a, args)\n"
            "    return x_new, v + dt / 2 * (a + a_new)"
            " -> v = v.copy()\n    for i in range(len(x)):\n        x[i] = x_new[i]\n"
            "        v[i] = v[i] + dt / 2 * (a[i] + own_forces(x, v + dt * a, args)[i])\n"
            "    return x_new, v"
        ),
        "written over its input": (
            "x_new = x + dt -> x += dt",
            "own_forces(x_new, -> own_forces(x,",
            "return x_new, -> return x,",
        ),
        "force limited": before(_PULL, "pull = np.clip(pull, -2.0, 2.0)"),
        "drag by the square of the speed": "damping[i] -> damping[i] * np.sqrt(v[i] @ v[i])",
        "a spring too many": before(
            "    for i in range(nodes):\n        force[i] *=",
            "force[0] += x[4] - x[0]",
            "force[4] -= x[4] - x[0]",
        ),
    },
}

MISTAKES: tuple[Mutant, ...] = by_hand(_TABLE)
