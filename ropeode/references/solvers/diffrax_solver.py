"""Adaptive diffrax solvers whose steps end on the sample times."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Any

import jax
import numpy as np

from ropeode import cache
from ropeode.cache import Source
from ropeode.precision import in_float64
from ropeode.problems import Problem
from ropeode.references.solvers.family import Family, abstract, compiled_once
from ropeode.references.solvers.solution import Solution, Stopwatch, finite_samples
from ropeode.references.solvers.solver import Solver

UNLIMITED = int(np.iinfo(np.int64).max)


@in_float64
def solve(
    problem: Problem,
    solver: Solver,
    rtol: float,
    atol: float | np.ndarray,
    *,
    max_steps: int = UNLIMITED,
    seconds: float = np.inf,
    longest_steps: np.ndarray | None = None,
    y0: np.ndarray | None = None,
    rounding_seed: int = 0,
    room: int = 0,
    compensated: bool = True,
    program: Callable | None = None,
) -> Solution:
    """Solve with diffrax in float64.

    Steps are clipped onto the sample times, and end just before declared jump times.

    Arguments:
        problem: what to solve.
        solver: one of `diffrax_program.SOLVERS`; any adaptive one, where not `compensated`.
        rtol: relative tolerance.
        atol: absolute tolerance: one number, or an array of the state's shape.
        max_steps: give up after so many steps.
        seconds: that the run may take, without compiling. It is cut off by its steps, whose
            duration a first few show; where it is not cut off, it does not depend on this.
        longest_steps: no step that starts in a frame may be longer than its entry,
            ``(frames,)``, in units of time.
        y0: initial state; by default the problem's.
        rounding_seed: where it is not 0, each number that the right-hand side rounds is moved by
            a unit in the last place; each seed gives other directions. See `rounding`.
        room: the program is one for so many sample times, or more. Of a problem that was cut short,
            this is the number before, so that none is compiled anew.
        compensated: as for `Family`.
        program: that is run, in place of the family's own.
    """
    start = problem.y0 if y0 is None else y0
    longest = np.full(problem.frames, np.inf) if longest_steps is None else longest_steps
    samples = len(problem.ts)
    spare = spare_samples(samples, room)
    compile_seconds = 0.0
    if program is None:
        family = Family.of(problem, solver, samples + spare, compensated)
        program, compile_seconds = compiled_once(_compiled, family)
    whole = Stopwatch()
    limit = max_steps if np.isinf(seconds) else min(max_steps, _few_steps(problem, solver))
    while True:
        this = Stopwatch()
        result, steps, saved, reached = jax.device_get(
            program(
                start.reshape(-1),
                jax.tree.leaves(problem.args),
                np.pad(problem.ts, (0, spare), mode="edge"),
                np.asarray(problem.jump_times, dtype=np.float64),
                np.float64(rtol),
                np.broadcast_to(np.float64(atol), start.shape).reshape(-1),
                np.int64(limit),
                np.pad(longest, (0, spare), mode="edge"),
                np.int64(rounding_seed),
            )
        )
        affordable = (seconds - whole.seconds) / this.seconds * limit
        if steps < limit or limit == max_steps or affordable < 2 * limit:
            break
        # From the start again: what a run does must not depend on how fast it is.
        limit = int(min(max_steps, affordable))
    taken = whole.seconds
    states = saved[:samples].reshape(-1, *problem.y0.shape)
    # diffrax can report success on a state that is not finite, so this is looked at as well.
    states = states[: finite_samples(states)]
    failure, ran_out = None, len(states) < samples and steps >= limit
    if ran_out:
        reason = f"{limit} steps did not suffice" if limit == max_steps else "its time was up"
        failure = f"stopped after t = {float(reached):g}: {reason}"
    elif len(states) < samples:
        # Not above: it imports diffrax.
        from ropeode.references.solvers import diffrax_program

        failure = f"stopped after t = {float(reached):g}: {diffrax_program.failure(result)}"
    return Solution(
        solver=solver,
        rtol=rtol,
        atol=atol,
        states=states,
        steps=int(steps),
        seconds=taken,
        compile_seconds=compile_seconds,
        failure=failure,
        reached=float(reached),
        ran_out=bool(ran_out),
    )


def spare_samples(samples: int, room: int = 0) -> int:
    """How many more sample times the program has: powers of four, so that few serve all."""
    return 4 ** math.ceil((max(samples, room) - 1).bit_length() / 2) - samples


def _few_steps(problem: Problem, solver: Solver) -> int:
    """Steps of a run that shows how long a step takes, and costs little in itself."""
    if not solver.implicit:
        # The right-hand side may cost as much as the product of a matrix and the state.
        return max(64, int(4096 * min(1.0, 100.0 / problem.y0.size)))
    # Each step factors matrices of the state's size.
    return max(4, int(4096 * min(1.0, (20.0 / problem.y0.size) ** 3)))


@functools.lru_cache(maxsize=64)
def _compiled(family: Family) -> Callable:
    description = _description(family) if cache.is_used() else None
    return cache.program(description, lambda: _source(family))[0]


def _source(family: Family) -> Source:
    # Not above: it imports diffrax.
    from ropeode.references.solvers.diffrax_program import solution_of

    return Source(solution_of(family), family.inputs())


def _description(family: Family) -> str:
    """What tells a program of the primary solver from all others.

    The right-hand side enters as the program that JAX lowers it to, with its derivative where
    an implicit solver needs that; neither its name nor its source text says what it does.
    """

    def with_slope(t: Any, y: Any, leaves: Any) -> Any:
        return jax.jvp(lambda y: family.field(t, y, leaves), (y,), (y,))

    function = with_slope if family.solver.implicit else family.field
    y0, leaves, *_ = family.inputs()
    parts = (
        str(family.solver),
        repr(family.inputs()),
        str(family.jumps > 0),
        *([] if family.compensated else ["as its library has it"]),
        jax.jit(function).lower(abstract(()), y0, leaves).as_text(),
    )
    return "\0".join(parts)
