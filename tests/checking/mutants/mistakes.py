"""Mistakes that people make, each as a change of a right stepper's text."""

from __future__ import annotations

from tests.checking.mutants.mutant import Mutant, replaced
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

_EULER = (
    replaced(explicit_euler, "dt missing", ("x + dt * v", "x + v")),
    replaced(explicit_euler, "dt squared", ("v + dt * a", "v + dt**2 * a")),
    replaced(explicit_euler, "force at the end", ("acceleration(t,", "acceleration(t + 100 * dt,")),
    replaced(explicit_euler, "half a step", ("x + dt * v", "x + dt / 2 * v")),
    replaced(explicit_euler, "velocity overwritten", ("v_new = v + dt * a", "v_new = dt * a")),
    replaced(explicit_euler, "position from the origin", ("x_new = x +", "x_new =")),
    replaced(
        explicit_euler,
        "damped once more, each step",
        ("v_new = v + dt * a", "v_new = 0.999 * (v + dt * a)"),
    ),
    replaced(
        semi_implicit_euler,
        "force of the next positions",
        ("a = acceleration(t, x, v, args)", "a = acceleration(t, x + v, v, args)"),
    ),
    replaced(semi_implicit_euler, "sign of the velocity", ("x + dt * v_new", "x - dt * v_new")),
    replaced(
        semi_implicit_euler, "mean velocity twice", ("x + dt * v_new", "x + dt * (v + v_new)")
    ),
    replaced(
        semi_implicit_euler,
        "damping per step",
        (
            "v_new = v + dt * a",
            "v_new = (1 - args.damping[:, None]) * v + dt * "
            "(a + (args.free * args.damping / args.mass)[:, None] * v)",
        ),
    ),
    replaced(
        semi_implicit_euler,
        "damping sign",
        ("v + dt * a", "v + dt * (a + 2 * (args.free * args.damping / args.mass)[:, None] * v)"),
    ),
    replaced(
        semi_implicit_euler,
        "no damping",
        ("acceleration(t, x, v, args)", "acceleration(t, x, 0 * v, args)"),
    ),
    replaced(
        semi_implicit_euler,
        "damping without mass",
        (
            "v + dt * a",
            "v + dt * (a + (args.free * args.damping * (1 / args.mass - 1))[:, None] * v)",
        ),
    ),
    replaced(
        semi_implicit_euler,
        "gravity twice",
        ("v + dt * a", "v + dt * (a + args.free[:, None] * args.gravity)"),
    ),
    replaced(
        semi_implicit_euler,
        "pinned nodes fall",
        ("v + dt * a", "v + dt * (a + (1 - args.free[:, None]) * args.gravity)"),
    ),
    replaced(
        semi_implicit_euler,
        "time stands still",
        ("acceleration(t, x", "acceleration(0.0, x"),
    ),
)

_VERLET = (
    replaced(velocity_verlet, "half missing", ("dt**2 / 2 * a", "dt**2 * a")),
    replaced(velocity_verlet, "dt once", ("dt**2 / 2 * a", "dt / 2 * a")),
    replaced(velocity_verlet, "dt cubed", ("dt**2 / 2 * a", "dt**3 / 2 * a")),
    replaced(velocity_verlet, "no second-order term", (" + dt**2 / 2 * a", "")),
    replaced(velocity_verlet, "stale acceleration", ("(a + a_new)", "(a + a)")),
    replaced(velocity_verlet, "new acceleration twice", ("(a + a_new)", "(a_new + a_new)")),
    replaced(velocity_verlet, "half missing in the velocity", ("v + dt / 2 *", "v + dt *")),
    replaced(
        velocity_verlet,
        "forces at old positions",
        ("acceleration(t + dt, x_new,", "acceleration(t + dt, x,"),
    ),
    replaced(
        velocity_verlet,
        "old time",
        ("acceleration(t + dt, x_new,", "acceleration(t, x_new,"),
    ),
    replaced(
        velocity_verlet,
        "half time",
        ("acceleration(t + dt, x_new,", "acceleration(t + dt / 2, x_new,"),
    ),
    replaced(velocity_verlet, "lagged damping", ("x_new, v_guess, args", "x_new, v, args")),
    replaced(
        velocity_verlet,
        "damping at the end only",
        ("acceleration(t, x, v, args)", "acceleration(t, x, 0 * v, args)"),
    ),
    replaced(
        velocity_verlet,
        "velocity before position",
        (
            "    x_new = x + dt * v + dt**2 / 2 * a\n    v_guess = v + dt * a\n",
            "    v_guess = v + dt * a\n    x_new = x + dt * v_guess + dt**2 / 2 * a\n",
        ),
    ),
    replaced(
        velocity_verlet,
        "damping per step",
        ("    return", "    v_new = (1 - 0.1 * args.damping[:, None]) * v_new\n    return"),
    ),
    replaced(leapfrog, "whole kick first", ("v + dt / 2 * a\n", "v + dt * a\n")),
    replaced(leapfrog, "two first kicks", ("dt / 2 * a_new", "dt / 2 * a")),
    replaced(leapfrog, "no second kick", ("(v_half + dt / 2 * a_new)", "v_half")),
    replaced(leapfrog, "old velocity drifts", ("x + dt * v_half", "x + dt * v")),
    replaced(leapfrog, "half a drift", ("x + dt * v_half", "x + dt / 2 * v_half")),
    replaced(
        leapfrog,
        "damping all explicit",
        ("(1 - rate * dt / 2)", "(1 - rate * dt)"),
        (" / (1 + rate * dt / 2)", ""),
    ),
    replaced(
        leapfrog,
        "damping all implicit",
        ("(1 - rate * dt / 2) * v", "v"),
        ("(1 + rate * dt / 2)", "(1 + rate * dt)"),
    ),
    replaced(
        leapfrog,
        "damping twice",
        ("rate * dt / 2) * v", "rate * dt) * v"),
        ("(1 + rate * dt / 2)", "(1 + rate * dt)"),
    ),
    replaced(leapfrog, "no damping", ("args.free * args.damping", "0 * args.damping")),
    replaced(
        leapfrog,
        "damping per step",
        (
            "rate = (args.free * args.damping / args.mass)[:, None]",
            "rate = (args.free * args.damping)[:, None] / dt",
        ),
    ),
    replaced(leapfrog, "damping without mass", ("args.damping / args.mass", "args.damping")),
    replaced(leapfrog, "old time", ("acceleration(t + dt,", "acceleration(t,")),
    replaced(
        leapfrog, "mean mass", ("args.damping / args.mass", "args.damping / args.mass.mean()")
    ),
    replaced(
        leapfrog, "mean damping", ("args.damping / args.mass", "args.damping.mean() / args.mass")
    ),
    replaced(position_verlet, "force at the start", ("t + dt / 2, x_half", "t + dt / 2, x")),
    replaced(position_verlet, "time of the start", ("acceleration(t + dt / 2,", "acceleration(t,")),
    replaced(
        position_verlet, "time of the end", ("acceleration(t + dt / 2,", "acceleration(t + dt,")
    ),
    replaced(
        position_verlet, "whole first drift", ("x_half = x + dt / 2 * v", "x_half = x + dt * v")
    ),
    replaced(position_verlet, "old velocity drifts", ("dt / 2 * v_new", "dt / 2 * v")),
    replaced(position_verlet, "half a kick", ("+ dt * a_half", "+ dt / 2 * a_half")),
    replaced(position_verlet, "no damping", ("args.free * args.damping", "0 * args.damping")),
    replaced(StormerVerlet, "starts from rest", ("y.x - dt * y.v + dt**2 / 2 * a", "y.x")),
    replaced(
        StormerVerlet, "starts without acceleration", ("- dt * y.v + dt**2 / 2 * a", "- dt * y.v")
    ),
    replaced(StormerVerlet, "starts forward", ("y.x - dt * y.v", "y.x + dt * y.v")),
    replaced(StormerVerlet, "starts without the half", ("dt**2 / 2 * a", "dt**2 * a")),
    replaced(StormerVerlet, "starts with the wrong sign", ("+ dt**2 / 2 * a", "- dt**2 / 2 * a")),
    replaced(
        StormerVerlet,
        "lagged damping",
        (
            "(2 * now - (1 - half) * before + dt**2 * a) / (1 + half)",
            "now + (1 - 2 * half) * (now - before) + dt**2 * a",
        ),
    ),
    replaced(
        StormerVerlet,
        "damping per step",
        (
            "(2 * now - (1 - half) * before + dt**2 * a) / (1 + half)",
            "now + (1 - system.damping.coefficient) * (now - before) + dt**2 * a",
        ),
    ),
    replaced(StormerVerlet, "no damping", ("half = system.damping.rate * dt / 2", "half = 0.0")),
    replaced(StormerVerlet, "dt once", ("before + dt**2 * a", "before + dt * a")),
    replaced(StormerVerlet, "half the force", ("before + dt**2 * a", "before + dt**2 / 2 * a")),
    replaced(
        StormerVerlet,
        "velocity from behind",
        ("(after - carried.before) / (2 * dt)", "(carried.now - carried.before) / dt"),
    ),
    replaced(
        StormerVerlet,
        "velocity from ahead",
        ("(after - carried.before) / (2 * dt)", "(after - carried.now) / dt"),
    ),
    replaced(
        StormerVerlet,
        "velocity twice",
        ("(after - carried.before) / (2 * dt)", "(after - carried.before) / dt"),
    ),
    replaced(StormerVerlet, "time of the last step", ("(t, now)", "(t - dt, now)")),
    replaced(StormerVerlet, "samples one step ahead", ("Phase(carried.now, v)", "Phase(after, v)")),
    replaced(
        StormerVerlet,
        "samples one step behind",
        ("Phase(carried.now, v)", "Phase(carried.before, v)"),
    ),
    replaced(StormerVerlet, "forces at old positions", ("(t, now)", "(t, before)")),
)

_RUNGE_KUTTA = (
    replaced(heun, "second stage at t", ("rhs(t + dt,", "rhs(t,")),
    replaced(heun, "second stage at half time", ("rhs(t + dt,", "rhs(t + dt / 2,")),
    replaced(heun, "half the slope", ("y + dt * k1", "y + dt / 2 * k1")),
    replaced(heun, "half missing", ("y + dt / 2 * (k1 + k2)", "y + dt * (k1 + k2)")),
    replaced(heun, "first slope only", ("(k1 + k2)", "(k1 + k1)")),
    replaced(heun, "second slope only", ("(k1 + k2)", "(k2 + k2)")),
    replaced(midpoint, "first slope only", ("y + dt * k2", "y + dt * k1")),
    replaced(midpoint, "at t", ("rhs(t + dt / 2,", "rhs(t,")),
    replaced(midpoint, "at the end", ("rhs(t + dt / 2,", "rhs(t + dt,")),
    replaced(midpoint, "whole slope", ("y + dt / 2 * k1", "y + dt * k1")),
    replaced(midpoint, "half the step", ("y + dt * k2", "y + dt / 2 * k2")),
    replaced(
        rk4,
        "all stages at t",
        ("k2 = rhs(t + dt / 2,", "k2 = rhs(t,"),
        ("k3 = rhs(t + dt / 2,", "k3 = rhs(t,"),
        ("rhs(t + dt,", "rhs(t,"),
    ),
    replaced(rk4, "second stage at t + dt", ("k2 = rhs(t + dt / 2,", "k2 = rhs(t + dt,")),
    replaced(rk4, "third stage at t", ("k3 = rhs(t + dt / 2,", "k3 = rhs(t,")),
    replaced(rk4, "last stage at half time", ("rhs(t + dt,", "rhs(t + dt / 2,")),
    replaced(rk4, "third stage from the first", ("dt / 2 * k2", "dt / 2 * k1")),
    replaced(rk4, "last stage from the second", ("dt * k3", "dt * k2")),
    replaced(rk4, "last stage with half a step", ("y + dt * k3", "y + dt / 2 * k3")),
    replaced(rk4, "second stage with a whole step", ("y + dt / 2 * k1", "y + dt * k1")),
    replaced(rk4, "stages from each other", ("y + dt / 2 * k2", "y + dt / 2 * (k1 + k2)")),
    replaced(rk4, "weights 1 2 2 2", ("2 * k3 + k4", "2 * k3 + 2 * k4")),
    replaced(rk4, "weights 1 2 1 1", ("2 * k3 + k4", "k3 + k4")),
    replaced(rk4, "weights 2 1 1 2", ("k1 + 2 * k2 + 2 * k3 + k4", "2 * k1 + k2 + k3 + 2 * k4")),
    replaced(
        rk4,
        "weights 1 3 3 1 over 8",
        ("dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)", "dt / 8 * (k1 + 3 * k2 + 3 * k3 + k4)"),
    ),
    replaced(
        rk4,
        "weights equal",
        ("dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)", "dt / 4 * (k1 + k2 + k3 + k4)"),
    ),
    replaced(rk4, "weights 1 4 1", ("(k1 + 2 * k2 + 2 * k3 + k4)", "(k1 + 4 * k2 + k4)")),
    replaced(rk4, "weights forgotten", ("(k1 + 2 * k2 + 2 * k3 + k4)", "(k1 + k2 + k3 + k4)")),
    replaced(rk4, "last slope counts twice", ("2 * k3 + k4", "2 * k3 + k3")),
    replaced(rk4, "dt / 8", ("dt / 6", "dt / 8")),
    replaced(rk4_apart, "positions by Euler", ("dt / 6 * (v1 + 2 * v2 + 2 * v3 + v4)", "dt * v1")),
    replaced(
        rk4_apart,
        "positions by the new velocity",
        ("dt / 6 * (v1 + 2 * v2 + 2 * v3 + v4)", "dt * (v + dt / 6 * (a1 + 2 * a2 + 2 * a3 + a4))"),
    ),
    replaced(
        rk4_apart,
        "forces frozen",
        ("acceleration(t + dt / 2, x3, v3, args)", "acceleration(t + dt / 2, x2, v2, args)"),
    ),
    replaced(
        rk4_apart,
        "positions of the stages frozen",
        ("acceleration(t + dt / 2, x2,", "acceleration(t + dt / 2, x,"),
        ("acceleration(t + dt / 2, x3,", "acceleration(t + dt / 2, x,"),
        ("acceleration(t + dt, x4,", "acceleration(t + dt, x,"),
    ),
    replaced(
        rk4_apart,
        "velocities of the stages frozen",
        ("x2, v2, args", "x2, v, args"),
        ("x3, v3, args", "x3, v, args"),
        ("x4, v4, args", "x4, v, args"),
    ),
    replaced(
        rk4_apart, "third position from the first slope", ("x + dt / 2 * v2", "x + dt / 2 * v1")
    ),
)

_OWN = (
    replaced(
        own_euler,
        "force sign",
        ("force[s] += pull", "force[s] -= pull"),
        ("force[s + 1] -= pull", "force[s + 1] += pull"),
    ),
    replaced(own_euler, "one-ended spring", ("        force[s + 1] -= pull\n", "")),
    replaced(
        own_euler, "other end pulled the same way", ("force[s + 1] -= pull", "force[s + 1] += pull")
    ),
    replaced(
        own_euler,
        "gravity times mass twice",
        ("args.mass[i] * args.gravity", "args.mass[i] ** 2 * args.gravity"),
    ),
    replaced(own_euler, "gravity without mass", ("args.mass[i] * args.gravity", "args.gravity")),
    replaced(
        own_euler,
        "gravity set and not added",
        ("force[i] += args.mass[i] * args.gravity", "force[i] = args.gravity"),
    ),
    replaced(own_euler, "no gravity", ("        force[i] += args.mass[i] * args.gravity\n", "")),
    replaced(
        own_euler,
        "gravity along y only",
        ("args.mass[i] * args.gravity", "args.mass[i] * args.gravity * np.array([0.0, 1.0, 0.0])"),
    ),
    replaced(own_euler, "missing mass", ("args.free[i] / args.mass[i]", "args.free[i]")),
    replaced(
        own_euler,
        "mass times force",
        ("args.free[i] / args.mass[i]", "args.free[i] * args.mass[i]"),
    ),
    replaced(
        own_euler,
        "mass of the first node",
        ("args.free[i] / args.mass[i]", "args.free[i] / args.mass[0]"),
    ),
    replaced(
        own_euler, "integer rest length", ("- args.rest_length[s])", "- int(args.rest_length[s]))")
    ),
    replaced(
        own_euler,
        "rounded rest length",
        ("- args.rest_length[s])", "- round(args.rest_length[s]))"),
    ),
    replaced(own_euler, "rest length 1", ("- args.rest_length[s])", "- 1.0)")),
    replaced(own_euler, "no rest length", ("(length - args.rest_length[s])", "length")),
    replaced(
        own_euler, "rest length of the first spring", ("args.rest_length[s]", "args.rest_length[0]")
    ),
    replaced(
        own_euler, "stiffness of the first spring", ("args.stiffness[s]", "args.stiffness[0]")
    ),
    replaced(
        own_euler,
        "stiffness per length",
        ("args.stiffness[s]", "args.stiffness[s] / args.rest_length[s]"),
    ),
    replaced(own_euler, "force not by direction", ("* d / length", "* d")),
    replaced(own_euler, "length by taxi", ("np.sqrt(d @ d)", "np.sum(np.abs(d))")),
    replaced(own_euler, "length in the plane", ("np.sqrt(d @ d)", "np.sqrt(d[:2] @ d[:2])")),
    replaced(
        own_euler, "no force along z", ("* d / length", "* d * np.array([1.0, 1.0, 0.0]) / length")
    ),
    replaced(
        own_euler,
        "springs only pull",
        (
            "        force[s] += pull\n",
            "        pull = pull * (length > args.rest_length[s])\n        force[s] += pull\n",
        ),
    ),
    replaced(own_euler, "last spring missing", ("range(nodes - 1)", "range(nodes - 2)")),
    replaced(own_euler, "first spring missing", ("range(nodes - 1)", "range(1, nodes - 1)")),
    replaced(
        own_euler,
        "last node without gravity",
        (
            "    for i in range(nodes):\n        force[i] += args.mass",
            "    for i in range(nodes - 1):\n        force[i] += args.mass",
        ),
    ),
    replaced(own_euler, "pinned node moved", ("*= args.free[i] / args.mass[i]", "/= args.mass[i]")),
    replaced(
        own_euler,
        "only the first node pinned",
        ("*= args.free[i] / args.mass[i]", "*= (i > 0) / args.mass[i]"),
    ),
    replaced(
        own_euler,
        "first node always pinned",
        ("*= args.free[i] / args.mass[i]", "*= (i > 0) * args.free[i] / args.mass[i]"),
    ),
    replaced(own_euler, "damping sign", ("force[i] -= args.damping", "force[i] += args.damping")),
    replaced(own_euler, "no damping", ("        force[i] -= args.damping[i] * v[i]\n", "")),
    replaced(
        own_euler,
        "damping by mass",
        ("args.damping[i] * v[i]", "args.damping[i] * args.mass[i] * v[i]"),
    ),
    replaced(
        own_euler, "damping of the first node", ("args.damping[i] * v[i]", "args.damping[0] * v[i]")
    ),
    replaced(
        own_euler,
        "damping of the speed along the spring only",
        ("        force[i] -= args.damping[i] * v[i]\n", ""),
        (
            "        force[s] += pull\n",
            "        u = d / length\n"
            "        pull = pull + args.damping[s] * ((v[s + 1] - v[s]) @ u) * u\n"
            "        force[s] += pull\n",
        ),
    ),
    replaced(
        own_euler,
        "missing force reset",
        (
            "def own_forces(x, v, args):",
            "FORCE = np.zeros((5, 3))\n\n\ndef own_forces(x, v, args):",
        ),
        ("force = np.zeros_like(x)", "force = FORCE"),
    ),
    replaced(
        own_euler,
        "positions updated node by node, forces computed between",
        (
            "    v_new = v + dt * own_forces(x, v, args)\n    return x + dt * v_new, v_new",
            "    x, v = x.copy(), v.copy()\n    for i in range(len(x)):\n"
            "        v[i] = v[i] + dt * own_forces(x, v, args)[i]\n"
            "        x[i] = x[i] + dt * v[i]\n"
            "    return x, v",
        ),
    ),
    replaced(
        own_euler,
        "division by a length of zero",
        ("        if length == 0:\n            continue\n", ""),
    ),
    replaced(own_verlet, "stale acceleration", ("(a + a_new)", "(a + a)")),
    replaced(own_verlet, "forces at old positions", ("own_forces(x_new,", "own_forces(x,")),
    replaced(own_verlet, "lagged damping", ("v + dt * a, args", "v, args")),
    replaced(
        own_verlet,
        "positions updated node by node, forces computed between",
        (
            "    a_new = own_forces(x_new, v + dt * a, args)\n"
            "    return x_new, v + dt / 2 * (a + a_new)",
            "    v = v.copy()\n    for i in range(len(x)):\n        x[i] = x_new[i]\n"
            "        v[i] = v[i] + dt / 2 * (a[i] + own_forces(x, v + dt * a, args)[i])\n"
            "    return x_new, v",
        ),
    ),
    replaced(
        own_verlet,
        "written over its input",
        ("x_new = x + dt", "x += dt"),
        ("own_forces(x_new,", "own_forces(x,"),
        ("return x_new,", "return x,"),
    ),
    replaced(
        own_verlet,
        "force limited",
        (
            "        force[s] += pull\n",
            "        pull = np.clip(pull, -2.0, 2.0)\n        force[s] += pull\n",
        ),
    ),
    replaced(
        own_verlet,
        "drag by the square of the speed",
        ("args.damping[i] * v[i]", "args.damping[i] * np.sqrt(v[i] @ v[i]) * v[i]"),
    ),
    replaced(
        own_verlet,
        "a spring too many",
        (
            "    for i in range(nodes):\n        force[i] *=",
            "    force[0] += x[4] - x[0]\n"
            "    force[4] -= x[4] - x[0]\n"
            "    for i in range(nodes):\n        force[i] *=",
        ),
    ),
)

MISTAKES: tuple[Mutant, ...] = (*_EULER, *_VERLET, *_RUNGE_KUTTA, *_OWN)
