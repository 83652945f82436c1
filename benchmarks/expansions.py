# ruff: noqa: D101, D102 (the methods of a stepper are known by their names)
"""How often the expansion of a step says something false of a random step.

    python benchmarks/expansions.py --right 1000 --wrong 400 --out outcomes.jsonl
    python benchmarks/expansions.py --out outcomes.jsonl --show

Right steps of known order, in JAX and in NumPy, with memory and without, explicit and implicit, are
expanded on random problems, in random units, far from the origin and late in time. The order that
is found must be the true one, or none. Wrong steps have a term too much, of random size: it must be
found, or be smaller than the error that the expansion states.

The outcome of each case is written to the file at once, as a line. `--show` tries nothing, and
prints a summary of the file.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from ropeode import Problem, Rope
from ropeode.problems import PROBLEMS
from ropeode.problems.links import LinearDamping
from ropeode.simulation import method_of
from ropeode.steppers import Stepper
from ropeode.theory import Expansion, StepSamples, expanded
from tests.checking.right_steppers import TABLEAUS as PUBLISHED

STATES = 6


class Numbers(NamedTuple):
    """Of the random equations: a network of three, in units of its own."""

    a: Any
    b: Any
    drive: Any
    frequency: Any
    damping: Any
    unit: Any
    time: Any
    off: Any


def network(t, y, n):
    inner = jnp.tanh(n.b @ ((y - n.off) / n.unit))
    return n.unit / n.time * (n.a @ inner + n.drive * jnp.sin(n.frequency * t / n.time))


def forces(t, x, v, n):
    z = (x - n.off) / n.unit
    pull = n.a @ jnp.tanh(n.b @ z) + n.drive * jnp.sin(n.frequency * t / n.time)
    return n.unit / n.time**2 * pull - n.damping / n.time * v


def damping(n):
    return LinearDamping(n.damping / n.time, n.damping / n.time)


# --- steps of one state, for `y' = f`; lists of stages, nodes in time
def runge_kutta(rows, weights, whole):
    def step(rhs, t, y, dt, args):
        slopes = []
        for row in rows:
            there = y + dt * sum((a * k for a, k in zip(row, slopes, strict=True) if a), 0 * y)
            slopes.append(whole(rhs(t + sum(row) * dt, there, args)))
        return y + dt * sum(b * k for b, k in zip(weights, slopes, strict=True) if b)

    return step


TABLEAUS = {
    "euler": (1, [[]], [1]),
    "midpoint": (2, [[], [1 / 2]], [0, 1]),
    "heun": (2, [[], [1]], [1 / 2, 1 / 2]),
    **{name: PUBLISHED[name] for name in ("ralston", "kutta3", "ssprk3")},
    "rk4": (4, [[], [1 / 2], [0, 1 / 2], [0, 0, 1]], [1 / 6, 1 / 3, 1 / 3, 1 / 6]),
    "three-eighths": PUBLISHED["three-eighths"],
    "dopri5": PUBLISHED["dormand-prince5"],
}


def as_it_is(values):
    return values


def substeps(step, count):
    def several(rhs, t, y, dt, args):
        for i in range(count):
            y = step(rhs, t + i * dt / count, y, dt / count, args)
        return y

    return several


def in_place(rhs, t, y, dt, args):
    """Heun's method number by number."""
    y = np.array(y)
    first = np.array(rhs(t, y, args))
    second = np.array(rhs(t + dt, y + dt * first, args))
    flat, a, b = y.reshape(-1), first.reshape(-1), second.reshape(-1)
    for i in range(flat.size):
        flat[i] += 0.5 * dt * (a[i] + b[i])
    return y


def converged(theta, tolerance, relative):
    """The theta method by fixed-point iteration, until it moves by less than a tolerance."""

    def step(rhs, t, y, dt, args):
        y = np.asarray(y)
        first = np.asarray(rhs(t, y, args))
        new = y + dt * first
        size = np.max(np.abs(y)) if relative else 1.0
        for _ in range(100):
            then = np.asarray(rhs(t + dt, new, args))
            better = y + dt * ((1 - theta) * first + theta * then)
            moved = np.max(np.abs(better - new))
            new = better
            if moved <= tolerance * size:
                break
        return new

    return step


def newton(tolerance):
    """Implicit midpoint with Newton's method and a difference quotient for its matrix."""

    def step(rhs, t, y, dt, args):
        y = np.asarray(y)
        flat = y.ravel()
        slope = np.asarray(rhs(t, y, args)).ravel()
        h = 1e-7 * (np.max(np.abs(y)) + 1e-300)
        matrix = np.stack(
            [
                (np.asarray(rhs(t, (flat + h * e).reshape(y.shape), args)).ravel() - slope) / h
                for e in np.eye(flat.size)
            ],
            axis=1,
        )
        k = slope
        for _ in range(30):
            then = np.asarray(rhs(t + dt / 2, (flat + dt / 2 * k).reshape(y.shape), args)).ravel()
            change = np.linalg.solve(np.eye(flat.size) - dt / 2 * matrix, then - k)
            k = k + change
            if np.max(np.abs(change)) <= tolerance * np.max(np.abs(k)):
                break
        return (flat + dt * k).reshape(y.shape)

    return step


def implicit_midpoint_jax(rhs, t, y, dt, args):
    def better(_, k):
        return rhs(t + dt / 2, y + dt / 2 * k, args)

    return y + dt * jax.lax.fori_loop(0, 60, better, rhs(t, y, args))


# --- steps of positions and velocities
def semi_implicit(acceleration, t, x, v, dt, args):
    v = v + dt * acceleration(t, x, v, args)
    return x + dt * v, v


def drift_first(acceleration, t, x, v, dt, args):
    x = x + dt * v
    return x, v + dt * acceleration(t + dt, x, v, args)


def leapfrog_heun(acceleration, t, x, v, dt, args):
    """Kick, drift, kick; order 2 even with damping, whose velocity is predicted."""
    a = acceleration(t, x, v, args)
    half = v + dt / 2 * a
    x = x + dt * half
    guess = v + dt * a
    guess = v + dt / 2 * (a + acceleration(t + dt, x, guess, args))
    return x, half + dt / 2 * acceleration(t + dt, x, guess, args)


def difference_velocity(acceleration, t, x, v, dt, args):
    new = x + dt * (v + dt * acceleration(t, x, v, args))
    return new, (new - x) / dt


# --- methods with memory
RK4 = runge_kutta(*TABLEAUS["rk4"][1:], as_it_is)


class AdamsBashforth2(Stepper):
    def init(self, system, t, y, dt):
        return y, system.rhs(t, y)

    def step(self, system, t, carried, dt):
        y, last = carried
        slope = system.rhs(t, y)
        return y + dt * (1.5 * slope - 0.5 * last), slope

    def state(self, system, t, carried, dt):
        return carried[0]


class AdamsBashforth3(Stepper):
    """With slopes before the start from Runge-Kutta steps backwards."""

    def init(self, system, t, y, dt):
        back = lambda t, y: RK4(lambda t, y, args: system.rhs(t, y), t, y, -dt, None)  # noqa: E731
        one = back(t, y)
        two = back(t - dt, one)
        return y, system.rhs(t - dt, one), system.rhs(t - 2 * dt, two)

    def step(self, system, t, carried, dt):
        y, one, two = carried
        slope = system.rhs(t, y)
        return y + dt / 12 * (23 * slope - 16 * one + 5 * two), slope, one

    def state(self, system, t, carried, dt):
        return carried[0]


class Leapfrog(Stepper):
    """The explicit midpoint rule over two steps, whose second root is -1."""

    def init(self, system, t, y, dt):
        return y, y - dt * system.rhs(t, y)

    def step(self, system, t, carried, dt):
        y, last = carried
        return last + 2 * dt * system.rhs(t, y), y

    def state(self, system, t, carried, dt):
        return carried[0]


class Bdf2(Stepper):
    """By fixed-point iteration to rounding, with the last state from Heun's method."""

    def init(self, system, t, y, dt):
        slope = system.rhs(t, y)
        guess = y - dt * slope
        return y, y - dt / 2 * (slope + system.rhs(t - dt, guess))

    def step(self, system, t, carried, dt):
        y, last = carried

        def better(_, new):
            return (4 * y - last + 2 * dt * system.rhs(t + dt, new)) / 3

        return jax.lax.fori_loop(0, 60, better, y + dt * system.rhs(t, y)), y

    def state(self, system, t, carried, dt):
        return carried[0]


class NumpyAdams(Stepper):
    def init(self, system, t, y, dt):
        return np.array(y), np.array(system.rhs(t, y))

    def step(self, system, t, carried, dt):
        y, last = carried
        slope = np.array(system.rhs(t, y))
        return y + dt * (1.5 * slope - 0.5 * last), slope

    def state(self, system, t, carried, dt):
        return carried[0]


class NumpyLeapfrog(NumpyAdams):
    def init(self, system, t, y, dt):
        return np.array(y), np.array(y) - dt * np.array(system.rhs(t, y))

    def step(self, system, t, carried, dt):
        y, last = carried
        return last + 2 * dt * np.array(system.rhs(t, y)), y


# Those that JAX compiles are built once: each is compiled for each kind of problem.
COMPILED_ANY = {
    **{
        f"{name} in JAX": (each[0], runge_kutta(*each[1:], as_it_is))
        for name, each in TABLEAUS.items()
    },
    "rk4 in 3 substeps in JAX": (4, substeps(RK4, 3)),
    "implicit midpoint in JAX": (2, implicit_midpoint_jax),
    "explicit-euler": (1, "explicit-euler"),
    "rk4": (4, "rk4"),
    "diffrax:Heun": (2, "diffrax:Heun"),
    "diffrax:Bosh3": (3, "diffrax:Bosh3"),
    "diffrax:Tsit5": (5, "diffrax:Tsit5"),
    "diffrax:Dopri8": (8, "diffrax:Dopri8"),
    "Adams-Bashforth 2 in JAX": (2, AdamsBashforth2()),
    "Adams-Bashforth 3 in JAX": (3, AdamsBashforth3()),
    "leapfrog in JAX": (2, Leapfrog()),
    "BDF2 in JAX": (2, Bdf2()),
}
COMPILED_SECOND = {
    "semi-implicit in JAX": (1, semi_implicit),
    "drift first in JAX": (1, drift_first),
    "kick drift kick in JAX": (2, leapfrog_heun),
    "velocity as a difference in JAX": (1, difference_velocity),
    "semi-implicit-euler": (1, "semi-implicit-euler"),
    "velocity-verlet": (2, "velocity-verlet"),
    "stormer-verlet": (2, "stormer-verlet"),
    "stormer-verlet:damping=lagged": (1, "stormer-verlet:damping=lagged"),
}


def in_numpy(function):
    """The same step of positions and velocities, which JAX cannot trace."""

    def step(acceleration, t, x, v, dt, args):
        x, v = np.asarray(x), np.asarray(v)
        x, v = function(lambda *at: np.asarray(acceleration(*at)), t, x, v, dt, args)
        return np.asarray(x), np.asarray(v)

    return step


def python_any(rng) -> tuple[str, int, Any]:
    kind = rng.integers(7)
    name = str(rng.choice(list(TABLEAUS)))
    order, *tableau = TABLEAUS[name]
    step = runge_kutta(*tableau, np.asarray)
    if kind == 0:
        return f"{name} in NumPy", order, step
    if kind == 1:
        return f"{name} in NumPy, substeps", order, substeps(step, int(rng.integers(2, 6)))
    if kind == 2:
        return "Heun in place", 2, in_place
    tolerance = 10.0 ** rng.uniform(-14, -10)
    if kind == 3:
        theta, relative = rng.choice([0.5, 0.7]), bool(rng.integers(2))
        words = f"theta {theta} to {tolerance:.0e} {'relative' if relative else 'absolute'}"
        return words, 2 if theta == 0.5 else 1, converged(theta, tolerance, relative)
    if kind == 4:
        return f"implicit midpoint, Newton to {tolerance:.0e}", 2, newton(tolerance)
    if kind == 5:
        return "Adams-Bashforth 2 in NumPy", 2, NumpyAdams()
    return "leapfrog in NumPy", 2, NumpyLeapfrog()


def python_second(rng):
    every = [(1, semi_implicit), (1, drift_first), (2, leapfrog_heun), (1, difference_velocity)]
    order, step = every[rng.integers(len(every))]
    return f"{step.__name__} in NumPy", order, in_numpy(step)


# --- problems
def numbers(rng) -> Numbers:
    unit, span = 10.0 ** rng.uniform(-6, 6), 10.0 ** rng.uniform(-3, 3)
    if rng.integers(2):
        unit, span = 1.0, 1.0
    off = unit * (0.0 if rng.integers(3) else 10.0 ** rng.uniform(0, 6))
    return Numbers(
        rng.normal(size=(3, 3)),
        rng.normal(size=(3, 3)),
        rng.normal(size=(3, 1)) * rng.integers(2),
        rng.uniform(0.5, 3.0),
        rng.uniform(0.05, 1.0),
        unit,
        span,
        off,
    )


def random_problem(rng) -> tuple[str, Problem, np.ndarray, np.ndarray, float]:
    """A problem, times and states near its own, and the longest step."""
    kind = rng.integers(5)
    late = 0.0 if rng.integers(4) else 10.0 ** rng.uniform(2, 6)
    if kind <= 1:
        n = numbers(rng)
        begin = late * n.time
        y = n.off + n.unit * rng.normal(size=(STATES, *((2,) if kind else ()), 3, 1))
        ts = begin + n.time * np.arange(3)
        if kind:
            y[:, 1] = n.unit / n.time * rng.normal(size=(STATES, 3, 1))
            problem = Problem.second_order(forces, y[0, 0], y[0, 1], ts, n, damping=damping)
        else:
            problem = Problem(network, y[0], ts, n)
        words = (
            f"{'forces' if kind else 'network'}, unit {n.unit:.0e}, time {n.time:.0e}, "
            f"off {n.off / n.unit:.0e}, late {late:.0e}"
        )
        return words, problem, begin + n.time * rng.uniform(0, 2, STATES), y, n.time
    if kind == 2:
        name = str(
            rng.choice(
                [
                    "oscillator",
                    "kepler",
                    "pendulum",
                    "henon-heiles",
                    "double-pendulum",
                    "van-der-pol",
                    "lorenz",
                    "forced",
                    "arenstorf",
                    "hires",
                    "pleiades",
                ]
            )
        )
        problem = PROBLEMS[name]()
        frame = float(np.diff(problem.ts)[0])
        y = problem.y0 + 0.1 * problem.scale * rng.normal(size=(STATES, *problem.y0.shape))
        return name, problem, rng.uniform(0, 2, STATES) * frame, y, frame
    unit = 1.0 if rng.integers(2) else 10.0 ** rng.uniform(-6, 6)
    nodes = int(rng.choice([5, 16]))
    given = {
        "start": (0.0, 0.0),
        "end": (unit * nodes, 0.3 * unit),
        "num_nodes": nodes,
        "node_mass": float(10.0 ** rng.uniform(-2, 2)),
        "stiffness": float(10.0 ** rng.uniform(-1, 3)),
        "damping": float(rng.choice([0.0, 0.01, 0.5])),
        "gravity": (0.0, -unit * rng.uniform(0.2, 5.0)),
    }
    problem = Rope(**given).problem(3)
    y = problem.y0 + unit * np.stack(
        [
            0.4 * rng.normal(size=(STATES, *problem.y0.shape[1:])),
            rng.normal(size=(STATES, *problem.y0.shape[1:])),
        ],
        axis=1,
    )
    words = (
        f"rope of {nodes}, unit {unit:.0e}, stiffness {given['stiffness']:.1e}, "
        f"mass {given['node_mass']:.1e}"
    )
    return words, problem, rng.uniform(0, 3, STATES), y, 1.0


def drawn(rng) -> tuple[str, int, Any, Any]:
    words, problem, t, y, longest = random_problem(rng)
    second = problem.mechanics is not None
    damped = second and problem.mechanics.damping is not None
    if rng.integers(2):
        name, order, step = python_second(rng) if second and rng.integers(2) else python_any(rng)
    else:
        table = COMPILED_SECOND if second and rng.integers(2) else COMPILED_ANY
        name = str(rng.choice(list(table)))
        order, step = table[name]
    if second and not damped and isinstance(step, str) and "verlet" in step:
        step, order, name = "semi-implicit-euler", 1, "semi-implicit-euler"
    if "lagged" in name and not np.any(np.asarray(problem.mechanics.damping(problem.args).rate)):
        order = 2
    return f"{name}; {words}", order, step, (problem, t, y, longest)


def expansion(step, problem, t, y, longest) -> Expansion:
    samples = StepSamples(problem, method_of(step, problem))
    return expanded(samples, t, y, longest)


def right(seed: int, index: int) -> dict[str, Any]:
    rng = np.random.default_rng([seed, index])
    words, order, step, where = drawn(rng)
    began = time.process_time()
    found = expansion(step, *where)
    line = {
        "kind": "right",
        "index": index,
        "words": words,
        "true": order,
        "found": found.order,
        "seen": found.seen,
    }
    lowest = [p for p in range(-1, order) if np.any(found.rate(p).known | found.start(p).known)]
    line["false terms"] = lowest
    line["one step"] = found.one_step
    line["seconds"] = time.process_time() - began
    return line


def with_fault(step, kind, size):
    """A step in NumPy or JAX on first-order states, with a term too much."""

    def faulty(rhs, t, y, dt, args):
        new = step(rhs, t, y, dt, args)
        if kind == "identity":
            return new + size * y
        return new + size * dt * np.asarray(rhs(t, y, args))

    return faulty


def wrong(seed: int, index: int) -> dict[str, Any]:
    rng = np.random.default_rng([seed, 1, index])
    words, problem, t, y, longest = random_problem(rng)
    name = str(rng.choice(list(TABLEAUS)))
    _, *tableau = TABLEAUS[name]
    kind = str(rng.choice(["identity", "equation"]))
    size = 10.0 ** (rng.uniform(-9, -2) if kind == "identity" else rng.uniform(-6, -1))
    step = with_fault(runge_kutta(*tableau, np.asarray), kind, size)
    found = expansion(step, problem, t, y, longest)
    at = -1 if kind == "identity" else 0
    term = found.rate(at)
    true = size * (
        y
        if kind == "identity"
        else np.stack(
            [np.asarray(problem.rhs(a, b, problem.args)) for a, b in zip(t, y, strict=True)]
        )
    )
    parts = 1 if problem.mechanics is None else 2
    off = np.abs((term.value - true).reshape(STATES, parts, -1)).max(axis=2).T
    big = np.abs(true.reshape(STATES, parts, -1)).max(axis=2).T
    excess = off / np.maximum(term.error, 1e-300)
    return {
        "kind": "wrong",
        "index": index,
        "words": f"{kind} off by {size:.1e}, {name}; {words}",
        "true": at,
        "found": found.order,
        "seen": found.seen,
        "excess": float(np.max(excess)),
        "above": float(np.max(big / np.maximum(term.error, 1e-300))),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--right", type=int, default=1000, help="right steps")
    parser.add_argument("--wrong", type=int, default=400, help="wrong steps")
    parser.add_argument("--seed", type=int, default=1, help="of their drawing")
    parser.add_argument("--out", type=Path, required=True, help="file of outcomes, *.jsonl")
    parser.add_argument("--show", action="store_true", help="the result; nothing is tried")
    options = parser.parse_args()
    if not options.show:
        with options.out.open("a") as file:
            for case, count in ((right, options.right), (wrong, options.wrong)):
                for index in range(count):
                    with jax.enable_x64(True):
                        line = case(options.seed, index)
                    file.write(json.dumps(line, default=int) + "\n")
                    file.flush()
    print(shown([json.loads(text) for text in options.out.read_text().splitlines()]))


def shown(lines: list[dict[str, Any]]) -> str:
    """The result, in words."""
    said = []
    for kind in ("right", "wrong"):
        own = [line for line in lines if line["kind"] == kind]
        false = [line for line in own if line["found"] not in (None, line["true"])]
        none = Counter(line["words"].split(";")[0] for line in own if line["found"] is None)
        said += [
            f"{len(own)} {kind} steps: {sum(line['found'] == line['true'] for line in own)} with "
            f"their true order, {none.total()} undetermined, {len(false)} with a false one.",
            *(f"- {line['words']}: {line['true']}, found {line['found']}" for line in false),
            "Undetermined: " + ", ".join(f"{name} {count}" for name, count in none.most_common()),
        ]
    return "\n".join(said)


if __name__ == "__main__":
    main()
