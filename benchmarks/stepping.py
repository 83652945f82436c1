"""Nanoseconds per step of a rope: a student's C++ loop, plain NumPy, and every stepper.

    python benchmarks/stepping.py [--repeats R] [--nodes 16,64,256,4096] [--markdown] [--only PART]

The C++ is `rope_loop.cpp`, compiled with `g++ -O3 -march=native`. Before anything is timed, all
three have to arrive at the same positions. Medians of interleaved runs; compiling is not
included. Ratios are to C++; a stepper that the assignment does not have is held against its
semi-implicit Euler step, and marked with an asterisk.

The limit is what this processor needs for one square root and one division per spring and
evaluation of the forces, many at a time (`throughput.cpp`); for constraint-verlet, which has to
finish one link before it begins the next, it is what a link waits for, without what is faster in
another order. Ensembles are 512 ropes side by side, on all cores; their nanoseconds are those of
one rope's step on one core.

Only what C++ or NumPy has is in that table, `against`. What a step of any stepper costs is in two
others, `evaluations` and `nodes` (see `step_costs.py`).
"""

from __future__ import annotations

import argparse
import platform
import shutil
import statistics
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import jax
import numpy as np
from step_costs import by_evaluations, by_nodes
from tabulate import tabulate

from ropeode import Problem, Rope, simulate, threads

SOURCE = Path(__file__).with_name("rope_loop.cpp")
THROUGHPUT = Path(__file__).with_name("throughput.cpp")
MEMBERS = 512

# The assignment's methods, and the stepper that does the same arithmetic.
CPP_METHODS = {
    "explicit-euler": "explicit-euler",
    "semi-implicit-euler": "semi-implicit-euler",
    "verlet": "stormer-verlet:start=rest,damping=per-step",
}
CPP_METHOD_OF = {stepper.split(":")[0]: method for method, stepper in CPP_METHODS.items()}

FRAMES = 4
NODE_STEPS = 1_500_000  # per run, so that each takes some milliseconds
NUMPY_NODE_STEPS = 50_000


def acceleration(x: np.ndarray, v: np.ndarray, args) -> np.ndarray:
    apart = x[:, 1:] - x[:, :-1]
    length = np.sqrt(np.sum(apart * apart, axis=0))
    pull = args.stiffness * (1.0 - args.rest_length / length) * apart
    force = -args.damping * v
    force[:, :-1] += pull
    force[:, 1:] -= pull
    return (force / args.mass + args.gravity) * args.free


def explicit_euler(x, v, dt, args):
    return x + dt * v, v + dt * acceleration(x, v, args)


def semi_implicit_euler(x, v, dt, args):
    v = v + dt * acceleration(x, v, args)
    return x + dt * v, v


def verlet(x, before, dt, args):
    undamped = acceleration(x, np.zeros_like(x), args)
    return x + (1 - args.damping) * (x - before) + dt**2 * undamped, x


def velocity_verlet(x, v, dt, args):
    half = args.damping / args.mass * dt / 2
    still = np.zeros_like(x)
    v = (1 - half) * v + dt / 2 * acceleration(x, still, args)
    x = x + dt * v
    return x, (v + dt / 2 * acceleration(x, still, args)) / (1 + half)


def rk4(x, v, dt, args):
    a1 = acceleration(x, v, args)
    v2 = v + dt / 2 * a1
    a2 = acceleration(x + dt / 2 * v, v2, args)
    v3 = v + dt / 2 * a2
    a3 = acceleration(x + dt / 2 * v2, v3, args)
    v4 = v + dt * a3
    a4 = acceleration(x + dt * v3, v4, args)
    return x + dt / 6 * (v + 2 * v2 + 2 * v3 + v4), v + dt / 6 * (a1 + 2 * a2 + 2 * a3 + a4)


NUMPY_STEPS: dict[str, Callable] = {
    "explicit-euler": explicit_euler,
    "semi-implicit-euler": semi_implicit_euler,
    "stormer-verlet": verlet,
    "velocity-verlet": velocity_verlet,
    "rk4": rk4,
}


def by_numpy(problem: Problem, stepper: str, steps: int, dt: float) -> tuple[list, np.ndarray]:
    """Nanoseconds per step, and the final positions, ``(dim, nodes)``."""
    step, args = NUMPY_STEPS[stepper], problem.args
    first, second = problem.y0
    if step is verlet:
        second = first
    started = time.perf_counter()
    for _ in range(steps):
        first, second = step(first, second, dt, args)
    return [(time.perf_counter() - started) / steps * 1e9], first


def by_ropeode(problem: Problem, stepper: str, steps: int) -> tuple[list[float], np.ndarray]:
    """Nanoseconds per step, and the final positions, ``(dim, nodes)``."""
    run = simulate(problem, stepper, steps // problem.frames)
    assert run.status == "ok", (stepper, steps)
    return [run.seconds / steps * 1e9], run.states[-1, 0]


def by_cpp(program: str, nodes: int, method: str, steps: int, dt: float) -> tuple[list, list]:
    """Nanoseconds per step of each repeat, and checksum and final position of the last mass."""
    command = [program, method, str(nodes), str(steps), repr(dt), "2"]
    words = subprocess.run(command, check=True, capture_output=True, text=True).stdout.split()
    end = words.index("sum")
    repeats = [float(word) for word in words[1:end]]
    total, x, y = (float(words[i]) for i in (end + 1, end + 3, end + 4))
    return repeats, [total / len(repeats), x, y]


def check(nodes: int, program: str | None) -> None:
    """C++, NumPy and ropeode arrive at the same positions."""
    problem, steps = Rope(num_nodes=nodes).problem(frames=2), 128
    for method, stepper in CPP_METHODS.items():
        _, x = by_ropeode(problem, stepper, steps)
        _, other = by_numpy(problem, stepper.split(":")[0], steps, 2 / steps)
        np.testing.assert_allclose(other, x, rtol=0, atol=1e-9)
        if program:
            _, numbers = by_cpp(program, nodes, method, steps, 2 / steps)
            np.testing.assert_allclose(numbers[1:], x[:, -1], rtol=0, atol=1e-9)
            np.testing.assert_allclose(numbers[0], np.sum(x), rtol=0, atol=1e-9 * nodes)


def compiled(folder: str, source: Path, *flags: str) -> str | None:
    """A C++ program, if there is a compiler."""
    compiler = shutil.which("g++")
    if compiler is None:
        return None
    program = str(Path(folder) / source.stem)
    subprocess.run([compiler, "-O3", "-march=native", *flags, "-o", program, source], check=True)
    return program


class Limits:
    """What this processor takes, in nanoseconds."""

    def __init__(self, folder: str):
        # Without the flag a square root stops for the sign of its operand.
        program = compiled(folder, THROUGHPUT, "-fno-math-errno")
        words = subprocess.check_output([program], text=True).split() if program else []
        self._times = dict(zip(words[::2], map(float, words[1::2]), strict=True))

    def of(self, stepper: str, nodes: int) -> str:
        """Of a step, as text; nothing where it is not known."""
        if not self._times:
            return ""
        if stepper == "constraint-verlet":
            return f"{(nodes - 1) * self._times['chain']:.0f}"
        evaluations = 4 if stepper == "rk4" else 1
        each = self._times["sqrt"] + self._times["div"]
        return f"{evaluations * (nodes - 1) * each:.0f}"


def by_ensemble(nodes: int, stepper: str, cores: int) -> Callable[[], tuple[list[float], None]]:
    """Measures nanoseconds per step of a rope among many, times the cores."""
    ensemble = Rope(num_nodes=nodes).ensemble(FRAMES, damping=np.linspace(0.0, 0.1, MEMBERS))
    steps = max(NODE_STEPS // nodes // FRAMES // 8, 64)

    def run() -> tuple[list[float], None]:
        started = time.perf_counter()
        simulate(ensemble, stepper, steps)
        seconds = time.perf_counter() - started
        return [seconds * cores / steps / FRAMES / MEMBERS * 1e9], None

    run()
    return run


def measured(nodes: int, repeats: int, program: str | None) -> dict[tuple[str, str], list[float]]:
    """All times in nanoseconds per step, by implementation and stepper (in C++: method)."""
    problem = Rope(num_nodes=nodes).problem(frames=FRAMES)
    steps = FRAMES * max(NODE_STEPS // nodes // FRAMES, 64)
    few = max(NUMPY_NODE_STEPS // nodes, 50)
    dt = FRAMES / steps
    runs: dict[tuple[str, str], Callable] = {}
    for method in CPP_METHODS if program else ():
        runs["C++", method] = lambda method=method: by_cpp(program, nodes, method, steps, dt)
    for name in (*NUMPY_STEPS, "constraint-verlet"):
        simulate(problem, name, 1)  # compiles
        runs["ropeode", name] = lambda name=name: by_ropeode(problem, name, steps)
        runs["ensemble", name] = by_ensemble(nodes, name, threads.cores())
        if name in NUMPY_STEPS:
            runs["NumPy", name] = lambda name=name: by_numpy(problem, name, few, dt)

    times: dict[tuple[str, str], list[float]] = {key: [] for key in runs}
    for _ in range(repeats):
        for key, run in runs.items():
            times[key] += run()[0]
    return times


def rows(nodes: int, times: dict[tuple[str, str], list[float]], limits: Limits) -> list[tuple]:
    """Of one table: a line for each stepper and implementation."""
    lines = []
    for name in (stepper for by, stepper in times if by == "ropeode"):
        method = CPP_METHOD_OF.get(name, "semi-implicit-euler")
        cpp = times.get(("C++", method))
        sources = {
            "ropeode": times["ropeode", name],
            "ensemble": times["ensemble", name],
            "C++": cpp,
            "NumPy": times.get(("NumPy", name)),
        }
        for by, found in sources.items():
            if not found:
                continue
            middle = statistics.median(found)
            lines.append(
                (
                    nodes if not lines else "",
                    name if by == "ropeode" else "",
                    by + ("*" if by == "C++" and name not in CPP_METHOD_OF else ""),
                    f"{middle:.0f}",
                    f"{min(found):.0f}-{max(found):.0f}",
                    f"{middle / statistics.median(cpp):.2f}" if cpp else "",
                    limits.of(name, nodes) if by == "ropeode" else "",
                )
            )
    return lines


def against(sizes: list[int], repeats: int) -> tuple[tuple[str, ...], list[tuple]]:
    """Headers and lines of the table beside C++ and NumPy."""
    lines = []
    with tempfile.TemporaryDirectory() as folder:
        program, limits = compiled(folder, SOURCE), Limits(folder)
        if program is None:
            print("No C++: there is no compiler (g++) on the search path.")
        for nodes in sizes:
            check(nodes, program)
            lines += rows(nodes, measured(nodes, repeats, program), limits)
    return ("nodes", "stepper", "by", "ns/step", "min-max", "/ C++", "limit"), lines


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--nodes", default="16,64,256,4096")
    parser.add_argument("--markdown", action="store_true")
    parser.add_argument("--only", choices=("against", "evaluations", "nodes"))
    given = parser.parse_args()

    sizes = list(map(int, given.nodes.split(",")))
    parts: dict[str, Callable] = {
        "against": lambda: against(sizes, given.repeats),
        "evaluations": lambda: by_evaluations((16, 256), given.repeats),
        "nodes": lambda: by_nodes(sizes, given.repeats),
    }
    style = "github" if given.markdown else "simple"
    cores = threads.cores()
    print(f"JAX {jax.__version__}, Python {platform.python_version()}, {cores} cores")
    for part, table in parts.items():
        if given.only in (None, part):
            headers, lines = table()
            print(
                "\n" + tabulate(lines, headers, tablefmt=style, disable_numparse=True), flush=True
            )
            if part == "against":
                print("\n\\* not in the assignment; this is the C++ semi-implicit Euler step")


if __name__ == "__main__":
    main()
