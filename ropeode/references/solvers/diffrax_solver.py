"""Adaptive diffrax solvers whose steps end on the sample times."""

from __future__ import annotations

import time

import jax
import numpy as np

from ropeode.precision import in_float64
from ropeode.problems.problem import Problem
from ropeode.references.solvers.family import Family
from ropeode.references.solvers.program_cache import compiled
from ropeode.references.solvers.solution import Solution, finite_samples
from ropeode.references.solvers.solver import Solver


@in_float64
def solve(
    problem: Problem,
    solver: Solver,
    rtol: float,
    atol: float,
    *,
    max_steps: int,
    longest_steps: np.ndarray | None = None,
    y0: np.ndarray | None = None,
    rounding_seed: int = 0,
) -> Solution:
    """Solve with diffrax in float64.

    Steps are clipped onto the sample times, and end just before declared jump times.

    Arguments:
        problem: what to solve.
        solver: one of `diffrax_program.SOLVERS`.
        rtol: relative tolerance.
        atol: absolute tolerance.
        max_steps: give up after so many steps.
        longest_steps: no step that starts in a frame may be longer than its entry,
            ``(frames,)``, in units of time.
        y0: initial state; by default the problem's.
        rounding_seed: where it is not 0, each number that the right-hand side rounds is moved by
            a unit in the last place; each seed gives other directions. See `rounding`.
    """
    start = problem.y0 if y0 is None else y0
    longest = np.full(problem.frames, np.inf) if longest_steps is None else longest_steps
    samples = len(problem.ts)
    # Powers of two, so that few programs serve all numbers of samples.
    spare = (1 << (samples - 1).bit_length()) - samples
    started = time.perf_counter()
    program, fresh = compiled(Family.of(problem, solver, samples + spare))
    compile_seconds = time.perf_counter() - started
    started = time.perf_counter()
    result, steps, saved, reached = jax.block_until_ready(
        program(
            start.reshape(-1),
            jax.tree.leaves(problem.args),
            np.pad(problem.ts, (0, spare), mode="edge"),
            np.asarray(problem.jump_times, dtype=np.float64),
            np.float64(rtol),
            np.float64(atol),
            np.int64(max_steps),
            np.pad(longest, (0, spare), mode="edge"),
            np.int64(rounding_seed),
        )
    )
    seconds = time.perf_counter() - started
    states = np.asarray(saved)[:samples].reshape(-1, *problem.y0.shape)
    # diffrax can report success on a state that is not finite, so this is looked at as well.
    states = states[: finite_samples(states)]
    failure = None
    if len(states) < samples:
        # Not above: it imports diffrax.
        from ropeode.references.solvers import diffrax_program

        reason = diffrax_program.failure(result, max_steps)
        failure = f"stopped after t = {float(reached):g}: {reason}"
    return Solution(
        solver=solver,
        rtol=rtol,
        atol=atol,
        states=states,
        steps=int(steps),
        seconds=seconds,
        compile_seconds=compile_seconds if fresh else 0.0,
        failure=failure,
        reached=float(reached),
    )
