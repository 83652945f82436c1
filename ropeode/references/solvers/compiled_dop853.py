"""DOP853 for one problem, as a compiled program.

SciPy's solver calls the right-hand side from Python twelve times in each step. For a run of many
thousand steps that takes minutes, where a compiled loop takes a second. The coefficients are
SciPy's, and the step control is that of its solver.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ropeode.precision import in_float64
from ropeode.problems import Problem
from ropeode.references.solvers.dop853 import (
    LARGEST_FACTOR,
    LEAST_FACTOR,
    SAFETY,
    TIGHTEST_RTOL,
    attempt,
)
from ropeode.references.solvers.family import Family, abstract, compiled_once
from ropeode.references.solvers.solution import Path, Solution, Stopwatch
from ropeode.references.solvers.solver import OWN_DOP853

# Steps of one call: the clock is read between two calls.
_STEPS, _NUMBERS = 4096, 2**20


class _State(NamedTuple):
    """Where a run is: at a time and state, with its slope and the next step's length there."""

    t: Any
    y: Any
    slope: Any
    h: Any
    rejected: Any
    sample: Any
    stuck: Any


@in_float64
def solve(
    problem: Problem,
    rtol: float,
    atol: float | np.ndarray,
    *,
    max_steps: int,
    seconds: float = np.inf,
) -> Solution:
    """Solve a problem without jump times, each sample time being the end of a step.

    Arguments are those of `scipy_solver.solve`.
    """
    y0, ts = problem.y0.reshape(-1), problem.ts
    leaves = jax.tree.leaves(problem.args)
    # Powers of two, so that few programs serve all numbers of samples.
    spare = (1 << (len(ts) - 1).bit_length()) - len(ts)
    padded = np.pad(ts, (0, spare), mode="edge")
    tolerances = np.float64(max(rtol, TIGHTEST_RTOL)), np.broadcast_to(atol, problem.y0.shape)
    tolerances = tolerances[0], np.float64(tolerances[1]).reshape(-1)
    advance, compile_seconds = compiled_once(_compiled, Family.of(problem, OWN_DOP853, len(padded)))
    stopwatch = Stopwatch()
    state = _start(problem, y0, *tolerances)
    times, states, slopes = [ts[:1]], [y0[None]], [state.slope[None]]
    steps, failure = 0, None
    while state.sample < len(ts):
        if state.stuck:
            failure = "the step size has become too small"
        elif steps >= max_steps:
            failure = f"{max_steps} steps did not suffice"
        elif stopwatch.seconds > seconds:
            failure = "its time was up"
        if failure:
            failure = f"stopped after t = {float(state.t):g}: {failure}"
            break
        state, many, *taken = advance(
            state, leaves, padded, *tolerances, np.int64(len(ts)), np.int64(max_steps - steps)
        )
        steps += int(many)
        for kept, new in zip((times, states, slopes), taken, strict=True):
            kept.append(np.asarray(new)[: int(many)])
    along = np.concatenate(slopes)
    path = Path(
        np.concatenate(times),
        np.concatenate(states),
        np.stack([along[:-1], along[1:]], axis=1),
    )
    return Solution(
        solver=OWN_DOP853,
        rtol=float(tolerances[0]),
        atol=atol,
        states=path.states[np.isin(path.times, ts)].reshape(-1, *problem.y0.shape),
        steps=steps,
        seconds=stopwatch.seconds,
        compile_seconds=compile_seconds,
        failure=failure,
        reached=float(state.t),
        ran_out=failure is not None and not state.stuck,
        path=path,
    )


def _start(problem: Problem, y: np.ndarray, rtol: np.float64, atol: np.ndarray) -> _State:
    """The start of a run, with a first step that hardly changes the state."""
    t, frame = problem.ts[0], problem.ts[1] - problem.ts[0]
    slope = np.asarray(problem.rhs(t, problem.y0, problem.args)).reshape(-1)
    scale = atol + np.abs(y) * rtol
    size, rate = np.linalg.norm(y / scale), np.linalg.norm(slope / scale)
    h = 0.01 * size / rate if min(size, rate) > 1e-5 else 1e-6
    h = max(min(h, frame), 10 * np.spacing(t))
    return _State(t, y, slope, np.float64(h), False, np.int64(1), False)


@functools.lru_cache(maxsize=16)
def _compiled(family: Family) -> Callable:
    y0, leaves, *_ = family.inputs()
    number, whole, truth = abstract(()), abstract((), np.int64), abstract((), np.bool_)
    state = _State(number, y0, y0, number, truth, whole, truth)
    inputs = (state, leaves, abstract((family.times,)), number, y0, whole, whole)
    return jax.jit(_program(family)).lower(*inputs).compile()


def _program(family: Family) -> Callable:
    """A function that takes some steps; returns the state, and the steps taken: how many, and the
    time, state and slope at the end of each.
    """
    size = int(np.prod(family.shape))
    capacity = max(64, min(_STEPS, _NUMBERS // size))

    def advance(
        state: _State, leaves: Any, ts: Any, rtol: Any, atol: Any, samples: Any, most: Any
    ) -> Any:
        def field(t: Any, y: Any) -> Any:
            return family.field(t, y, leaves)

        def goes_on(loop: Any) -> Any:
            state, count, *_ = loop
            arrived = state.sample >= samples
            return ~arrived & ~state.stuck & (count < capacity) & (count < most)

        def step(loop: Any) -> Any:
            state, count, times, ends, slopes = loop
            smallest = 10 * (jnp.nextafter(state.t, jnp.inf) - state.t)
            stuck = state.rejected & (state.h < smallest)
            tried = jnp.where(state.rejected, state.h, jnp.maximum(state.h, smallest))
            stop = ts[state.sample]
            t_new = jnp.minimum(state.t + tried, stop)
            h = t_new - state.t
            y_new, slope_new, error = attempt(
                field, state.t, state.y, state.slope, h, rtol, atol, jnp
            )
            factor = SAFETY * error ** (-1 / 8)
            # Not so for NaN, which is no error within the tolerance.
            accepted = error < 1
            growth = jnp.where(error == 0, LARGEST_FACTOR, jnp.minimum(LARGEST_FACTOR, factor))
            growth = jnp.where(state.rejected, jnp.minimum(1.0, growth), growth)
            shrinkage = jnp.fmax(LEAST_FACTOR, factor)
            times = times.at[count].set(t_new)
            ends = ends.at[count].set(y_new)
            slopes = slopes.at[count].set(slope_new)
            new = _State(
                t=jnp.where(accepted, t_new, state.t),
                y=jnp.where(accepted, y_new, state.y),
                slope=jnp.where(accepted, slope_new, state.slope),
                h=h * jnp.where(accepted, growth, shrinkage),
                rejected=~accepted,
                sample=state.sample + (accepted & (t_new == stop)),
                stuck=stuck,
            )
            # A rejected step's end is overwritten by the next.
            return new, count + accepted, times, ends, slopes

        rows = jnp.zeros((capacity, size))
        start = (state, jnp.asarray(0), jnp.zeros(capacity), rows, rows)
        return jax.lax.while_loop(goes_on, step, start)

    return advance
