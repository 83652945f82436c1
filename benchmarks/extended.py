"""Extended precision: the translated right-hand side against one written for heyoka by hand.

    python benchmarks/extended.py [--frames N] [--bits B] [--repeats R]

Both solve the default rope by Taylor series with the same precision and tolerance; compiling and
running are timed apart, interleaved, and what their ends are apart is told. The float64
reference of the same rope stands beside them.
"""

from __future__ import annotations

import argparse
import statistics
import time

import heyoka
import numpy as np
from tabulate import tabulate

from ropeode import Problem, Rope, reference
from ropeode.references.extended.taylor import solve


def by_hand(problem: Problem) -> list[tuple[object, object]]:
    """The rope's equations in heyoka's own words."""
    args = problem.args
    nodes = len(args.mass)
    x = heyoka.make_vars(*[f"x{i}" for i in range(nodes)])
    y = heyoka.make_vars(*[f"y{i}" for i in range(nodes)])
    u = heyoka.make_vars(*[f"u{i}" for i in range(nodes)])
    v = heyoka.make_vars(*[f"v{i}" for i in range(nodes)])
    force_x = [
        m * args.gravity[0, 0] - c * w for m, c, w in zip(args.mass, args.damping, u, strict=True)
    ]
    force_y = [
        m * args.gravity[1, 0] - c * w for m, c, w in zip(args.mass, args.damping, v, strict=True)
    ]
    for i in range(nodes - 1):
        dx, dy = x[i + 1] - x[i], y[i + 1] - y[i]
        length = heyoka.sqrt(dx * dx + dy * dy)
        pull = args.stiffness[i] * (length - args.rest_length[i]) / length
        force_x[i] += pull * dx
        force_y[i] += pull * dy
        force_x[i + 1] -= pull * dx
        force_y[i + 1] -= pull * dy
    free = args.free
    rates = [*(f * w for f, w in zip(free, u, strict=True))]
    rates += [f * w for f, w in zip(free, v, strict=True)]
    rates += [f * g / m for f, g, m in zip(free, force_x, args.mass, strict=True)]
    rates += [f * g / m for f, g, m in zip(free, force_y, args.mass, strict=True)]
    return list(zip([*x, *y, *u, *v], [r + 0.0 * x[0] for r in rates], strict=True))


def handwritten(problem: Problem, bits: int) -> tuple[float, float, np.ndarray]:
    began = time.perf_counter()
    real = heyoka.real
    taylor = heyoka.taylor_adaptive(
        by_hand(problem),
        np.array([real(float(entry), bits) for entry in problem.y0.reshape(-1)]),
        tol=real(2.0 ** (1 - bits), bits),
        fp_type=real,
        prec=bits,
        compact_mode=True,
    )
    compiled = time.perf_counter()
    for t in problem.ts[1:]:
        taylor.propagate_until(real(float(t), bits))
    return compiled - began, time.perf_counter() - compiled, taylor.state.copy()


def translated(problem: Problem, bits: int) -> tuple[float, float, np.ndarray]:
    run = solve(problem, precision=bits)
    return run.compile_seconds, run.seconds, run.states[-1].reshape(-1)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--frames", type=int, default=50, help="(default 50)")
    parser.add_argument("--bits", type=int, default=113, help="(default 113: quadruple)")
    parser.add_argument("--repeats", type=int, default=5, help="(default 5)")
    options = parser.parse_args()
    problem = Rope().problem(options.frames)
    works = {"translated": translated, "by hand": handwritten}
    times = {name: ([], []) for name in works}
    ends = {}
    for _ in range(options.repeats):
        # heyoka keeps what it has compiled; each run is to compile anew.
        heyoka.llvm_state.clear_memcache()
        for name, work in works.items():
            compiling, running, ends[name] = work(problem, options.bits)
            times[name][0].append(compiling)
            times[name][1].append(running)
            heyoka.llvm_state.clear_memcache()
    known = reference(problem).certificate
    medians = {name: [statistics.median(each) for each in pair] for name, pair in times.items()}
    rows = [
        (
            name,
            f"{medians[name][0]:.2f}",
            f"{medians[name][1]:.2f}",
            f"{min(times[name][1]):.2f} to {max(times[name][1]):.2f}",
            f"{medians[name][1] / medians['by hand'][1]:.2f}",
        )
        for name in works
    ]
    print(f"{options.frames} frames, {options.bits} bits, {options.repeats} interleaved runs\n")
    head = ["", "compile s", "run s", "spread", "run, ratio"]
    print(tabulate(rows, head, tablefmt="github", disable_numparse=True))
    apart = np.max(np.abs((ends["translated"] - ends["by hand"]).astype(np.float64)))
    print(f"\nEnds are {apart:.1e} apart.")
    print(
        f"All float64 runs of a reference: {known.seconds:.2f} s and {known.compile_seconds:.2f} s "
        "to compile."
    )


if __name__ == "__main__":
    main()
