"""Time to a reference of a given accuracy: ropeode's primary solver against SciPy's DOP853.

    python benchmarks/reference.py [--repeats R] [--frames N] [--members M]

For each accuracy (1e-9 and 1e-12 of the rope's coordinates, and 1e-11) both solvers get the
loosest tolerance, in steps of a factor of 2, at which their *true* error over all samples of
the default rope is within it; the truth is ropeode's reference at its tightest. SciPy gets a
right-hand side in vectorised NumPy, and is timed both as users call it (`solve_ivp` with
`t_eval`, which interpolates) and stepped to each sample. Medians of interleaved runs;
compiling is reported apart.

Then whole certified references of ropes that differ in damping and stiffness: one by one, and as
an ensemble.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.integrate import DOP853, solve_ivp
from tabulate import tabulate

from ropeode import Problem, Rope, each_reference, reference
from ropeode.norms import distance, norm_for
from ropeode.problems import Ensemble
from ropeode.references import DOPRI8, RADAU9
from ropeode.references.solvers import diffrax_solver
from ropeode.threads import cores


def numpy_rhs(problem: Problem) -> Callable:
    args = problem.args

    def rhs(t, y):
        x, v = y.reshape(problem.y0.shape)
        apart = x[:, 1:] - x[:, :-1]
        length = np.sqrt(np.sum(apart * apart, axis=0))
        pull = args.stiffness * (1.0 - args.rest_length / length) * apart
        force = -args.damping * v
        force[:, :-1] += pull
        force[:, 1:] -= pull
        return np.concatenate([v.ravel(), ((force / args.mass + args.gravity) * args.free).ravel()])

    return rhs


def by_ropeode(problem: Problem, rtol: float) -> np.ndarray:
    return diffrax_solver.solve(problem, DOPRI8, rtol, rtol * problem.scale, max_steps=10**6).states


def by_solve_ivp(problem: Problem, rtol: float) -> np.ndarray:
    solved = solve_ivp(
        numpy_rhs(problem),
        (problem.ts[0], problem.ts[-1]),
        problem.y0.ravel(),
        method="DOP853",
        t_eval=problem.ts,
        rtol=rtol,
        atol=rtol * problem.scale,
    )
    return solved.y.T.reshape(-1, *problem.y0.shape)


def by_clipped_scipy(problem: Problem, rtol: float) -> np.ndarray:
    run = DOP853(
        numpy_rhs(problem), problem.ts[0], problem.y0.ravel(), problem.ts[1], rtol=rtol,
        atol=rtol * problem.scale,
    )  # fmt: skip
    states = [problem.y0]
    for t in problem.ts[1:]:
        run.t_bound, run.status = t, "running"
        while run.status == "running":
            run.step()
        states.append(run.y.reshape(problem.y0.shape))
    return np.array(states)


SOLVERS = {
    "ropeode (diffrax Dopri8)": by_ropeode,
    "SciPy DOP853, solve_ivp": by_solve_ivp,
    "SciPy DOP853, clipped": by_clipped_scipy,
}


def loosest_tolerance(
    solve: Callable, problem: Problem, truth: np.ndarray, accuracy: float
) -> tuple[float, float] | None:
    """The loosest rtol that keeps the true error within the accuracy, and that error."""
    norm, rtol = norm_for(problem), 1e-6
    while rtol > 2.3e-14:
        error = float(np.max(distance(problem, norm, solve(problem, rtol), truth)))
        if error <= accuracy:
            return rtol, error
        rtol /= 2
    return None


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--repeats", type=int, default=7)
    parser.add_argument("--frames", type=int, default=20)
    parser.add_argument("--members", type=int, default=256)
    given = parser.parse_args()

    problem = Rope().problem(frames=given.frames)
    known = reference(problem)
    first = diffrax_solver.solve(problem, RADAU9, 1e-6, 1e-4, max_steps=10)
    del first
    diffrax_solver._compiled.cache_clear()
    compiled = diffrax_solver.solve(problem, DOPRI8, 1e-6, 1e-4, max_steps=10**6)
    print(f"Default rope, {given.frames} frames; truth: bound {known.bound()[-1]:.1e}.")
    print(f"ropeode compiles for {compiled.compile_seconds:.2f} s, once.")

    rows = []
    for accuracy in (1e-9 * problem.scale, 1e-12 * problem.scale, 1e-11):
        chosen = {
            name: loosest_tolerance(solve, problem, known.states, accuracy)
            for name, solve in SOLVERS.items()
        }
        times: dict[str, list[float]] = {name: [] for name in SOLVERS}
        for _ in range(given.repeats):
            for name, solve in SOLVERS.items():
                if chosen[name]:
                    started = time.perf_counter()
                    solve(problem, chosen[name][0])
                    times[name].append(time.perf_counter() - started)
        ours = statistics.median(times[next(iter(SOLVERS))] or [np.nan])
        for name in SOLVERS:
            if chosen[name] is None:
                rows.append((f"{accuracy:.0e}", name, "not reached", "", "", ""))
                continue
            error = chosen[name][1]
            middle = statistics.median(times[name])
            spread = f"{min(times[name]) * 1e3:.2f}-{max(times[name]) * 1e3:.2f}"
            rows.append(
                (f"{accuracy:.0e}", name, f"{error:.1e}", f"{middle * 1e3:.2f}", spread,
                 f"{middle / ours:.1f}")
            )  # fmt: skip
    headers = ("accuracy", "solver", "true error", "ms", "min-max", "ratio")
    print(tabulate(rows, headers=headers, disable_numparse=True))

    of_an_ensemble(given.frames, given.members)


def of_an_ensemble(frames: int, members: int) -> None:
    """Print how many references a second gives, and how far those of an ensemble differ."""
    draw = np.random.default_rng(1)
    ropes = Rope().ensemble(
        frames,
        damping=draw.uniform(0.01, 0.2, members),
        stiffness=draw.uniform(50.0, 200.0, members),
    )
    few = [ropes[index] for index in range(min(members, 16))]
    reference(few[0])
    list(each_reference(Ensemble.of(few[:1])))

    def timed(solve: Callable[[], Any], count: int) -> tuple[Any, tuple[str, ...]]:
        clock, processors = time.perf_counter(), time.process_time()
        found = solve()
        clock, processors = time.perf_counter() - clock, time.process_time() - processors
        return found, (
            str(count),
            f"{1e3 * clock / count:.0f}",
            f"{1e3 * processors / count:.0f}",
            f"{count / clock:.1f}",
        )

    alone, one_by_one = timed(lambda: [reference(each) for each in few], len(few))
    single, one_thread = timed(lambda: list(each_reference(ropes, workers=1)), members)
    together, all_threads = timed(lambda: reference(ropes), members)
    headers = ("references", "members", "ms each", "ms of processors", "references/s")
    rows = [
        ("one by one", *one_by_one),
        ("ensemble, one thread", *one_thread),
        (f"ensemble, {cores()} threads", *all_threads),
    ]
    print(tabulate(rows, headers=headers, disable_numparse=True))

    assert all(
        a.states.tobytes() == b.states.tobytes() for a, b in zip(single, together, strict=True)
    )
    assert all(
        a.states.tobytes() == b.states.tobytes() for a, b in zip(alone, together, strict=False)
    )
    ratios = [b.bound()[-1] / a.bound()[-1] for a, b in zip(alone, together, strict=False)]
    print(
        "States are the same to the last bit; the ensemble's bounds are "
        f"{min(ratios):.2f} to {max(ratios):.2f} times those alone."
    )


if __name__ == "__main__":
    main()
