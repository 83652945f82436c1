"""Adaptive diffrax solvers whose steps end on the sample times."""

# Equinox modules declare fields that a wrapper gives as properties; pyright cannot see that.
# pyright: reportAssignmentType=false, reportCallIssue=false
from __future__ import annotations

import functools
import time
from collections.abc import Callable
from typing import Any

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import optimistix

from ropeode.precision import in_float64
from ropeode.problems.problem import Problem
from ropeode.references.solution import Solution, finite_samples

_ROOT_RTOL = 1e-9


def _dopri8(rtol: Any, atol: Any) -> diffrax.AbstractSolver:
    del rtol, atol
    return diffrax.Dopri8()


def _kvaerno5(rtol: Any, atol: Any) -> diffrax.AbstractSolver:
    """Kvaerno5 with Newton's method, and a new Jacobian in each iteration.

    Its own root finder keeps one for a whole step, and rejects step after step where a solution
    enters a boundary layer: Van der Pol's equation with epsilon = 1e-6 took 4810 steps in place
    of 290, or did not start at all. Newton's method squares its error, so that a tolerance
    below `_ROOT_RTOL` asks for what rounding does not give, and ends in steps of no length.
    """
    root_rtol: Any = jnp.maximum(rtol, _ROOT_RTOL)
    newton = optimistix.Newton(rtol=root_rtol, atol=root_rtol / rtol * atol)
    return diffrax.Kvaerno5(root_finder=newton)


SOLVERS: dict[str, Callable[[Any, Any], diffrax.AbstractSolver]] = {
    "Dopri8": _dopri8,
    "Kvaerno5": _kvaerno5,
}


class _StepLimit(diffrax.AbstractAdaptiveStepSizeController):
    """A controller that gives up after a number of steps known at run time only.

    `diffeqsolve(max_steps=...)` is compiled in, which would cost a compilation for each rung
    of a tolerance ladder.
    """

    controller: diffrax.AbstractAdaptiveStepSizeController
    limit: Any

    rtol = property(lambda self: self.controller.rtol)
    atol = property(lambda self: self.controller.atol)
    norm = property(lambda self: self.controller.norm)

    def wrap(self, direction: Any) -> _StepLimit:
        """Pass the direction of time on."""
        return _StepLimit(self.controller.wrap(direction), self.limit)

    def init(self, *inputs: Any) -> tuple:
        """Start the count beside the inner controller's state."""
        t1, inner = self.controller.init(*inputs)
        return t1, (jnp.asarray(0), inner)

    def adapt_step_size(self, *inputs: Any) -> tuple:
        """Let the inner controller choose, and count."""
        *inputs, (count, inner) = inputs
        *choice, inner, result = self.controller.adapt_step_size(*inputs, inner)
        count = count + 1
        spent = (count >= self.limit) & diffrax.is_okay(result)
        result = diffrax.RESULTS.where(spent, diffrax.RESULTS.max_steps_reached, result)
        return *choice, (count, inner), result


class _LongestSteps(diffrax.AbstractAdaptiveStepSizeController):
    """A controller that takes no step longer than the frame in which it starts allows.

    `PIDController(dtmax=...)` knows one length for all frames.
    """

    controller: diffrax.AbstractAdaptiveStepSizeController
    ts: Any
    longest: Any

    rtol = property(lambda self: self.controller.rtol)
    atol = property(lambda self: self.controller.atol)
    norm = property(lambda self: self.controller.norm)

    def wrap(self, direction: Any) -> _LongestSteps:
        """Pass the direction of time on."""
        return _LongestSteps(self.controller.wrap(direction), self.ts, self.longest)

    def init(self, *inputs: Any) -> tuple:
        """Shorten the first step."""
        t1, inner = self.controller.init(*inputs)
        return self._shortened(inputs[1], t1), inner

    def adapt_step_size(self, *inputs: Any) -> tuple:
        """Let the inner controller choose, and shorten the step."""
        keep, t0, t1, *more = self.controller.adapt_step_size(*inputs)
        return keep, t0, self._shortened(t0, t1), *more

    def _shortened(self, t0: Any, t1: Any) -> Any:
        frame = jnp.searchsorted(self.ts, t0, side="right") - 1
        return jnp.minimum(t1, t0 + self.longest[jnp.clip(frame, 0, len(self.longest) - 1)])


@in_float64
def solve(
    problem: Problem,
    solver: str,
    rtol: float,
    atol: float,
    *,
    max_steps: int,
    longest_steps: np.ndarray | None = None,
    y0: np.ndarray | None = None,
) -> Solution:
    """Solve with diffrax in float64.

    Steps are clipped onto the sample times, because the dense output of Dopri8 is of order 5
    only, and end just before declared jump times. The state is one flat array, which is the
    fastest form for diffrax.

    Arguments:
        problem: what to solve.
        solver: one of `SOLVERS`.
        rtol: relative tolerance.
        atol: absolute tolerance.
        max_steps: give up after so many steps.
        longest_steps: no step that starts in a frame may be longer than its entry,
            ``(frames,)``, in units of time.
        y0: initial state, where it is not the problem's.
    """
    start = problem.y0 if y0 is None else y0
    longest = np.float64(np.inf) if longest_steps is None else _one_or_each(longest_steps)
    leaves, tree = jax.tree.flatten(problem.args)
    started = time.perf_counter()
    before = _program.cache_info().misses
    program = _program(
        solver,
        problem.rhs,
        problem.y0.shape,
        tree,
        tuple((leaf.shape, leaf.dtype) for leaf in leaves),
        len(problem.ts),
        len(problem.jump_times),
        longest.ndim == 1,
    )
    compile_seconds = time.perf_counter() - started
    started = time.perf_counter()
    result, steps, saved = jax.block_until_ready(
        program(
            start.reshape(-1),
            problem.args,
            problem.ts,
            np.asarray(problem.jump_times, dtype=np.float64),
            np.float64(rtol),
            np.float64(atol),
            np.int64(max_steps),
            longest,
        )
    )
    seconds = time.perf_counter() - started
    states = np.asarray(saved).reshape(-1, *problem.y0.shape)
    # diffrax can report success on a state that is not finite, so this is looked at as well.
    states = states[: finite_samples(states)]
    failure = None
    if len(states) < len(problem.ts):
        reason = _reason(result, max_steps)
        failure = f"stopped after t = {problem.ts[max(len(states) - 1, 0)]:g}: {reason}"
    return Solution(
        solver=f"diffrax {solver}",
        rtol=rtol,
        atol=atol,
        states=states,
        steps=int(steps),
        seconds=seconds,
        compile_seconds=compile_seconds if _program.cache_info().misses > before else 0.0,
        failure=failure,
    )


def _one_or_each(longest: np.ndarray) -> Any:
    """One length where all are the same but for rounding."""
    return np.mean(longest) if np.ptp(longest) <= 1e-9 * np.max(longest) else longest


def _reason(result: diffrax.RESULTS, max_steps: int) -> str:
    """Why a run ended early, in words that do not speak of diffrax's own arguments."""
    if result == diffrax.RESULTS.max_steps_reached:
        return f"{max_steps} steps did not suffice"
    if diffrax.is_successful(result):
        return "the state is not finite"
    return str(diffrax.RESULTS[result]).strip().split(". ")[0]


@functools.lru_cache(maxsize=64)
def _program(
    solver: str,
    rhs: Callable,
    shape: tuple[int, ...],
    args_tree: Any,
    args_leaves: tuple,
    times: int,
    jumps: int,
    own_lengths: bool,
) -> Callable:
    """Compile; tolerances and all numbers of the problem are run-time values."""

    def field(t: Any, y: Any, args: Any) -> Any:
        return rhs(t, y.reshape(shape), args).reshape(-1)

    def run(
        y0: Any, args: Any, ts: Any, jump_ts: Any, rtol: Any, atol: Any, limit: Any, longest: Any
    ) -> Any:
        if own_lengths:
            inner = _LongestSteps(diffrax.PIDController(rtol=rtol, atol=atol), ts, longest)
        else:
            inner = diffrax.PIDController(rtol=rtol, atol=atol, dtmax=longest)
        controller = diffrax.ClipStepSizeController(
            inner,
            step_ts=ts,
            jump_ts=jump_ts if jumps else None,
        )
        solution = diffrax.diffeqsolve(
            diffrax.ODETerm(field),
            SOLVERS[solver](rtol, atol),
            ts[0],
            ts[-1],
            None,
            y0,
            args,
            saveat=diffrax.SaveAt(ts=ts),
            stepsize_controller=_StepLimit(controller, limit),
            max_steps=None,
            adjoint=diffrax.ForwardMode(),
            throw=False,
        )
        return solution.result, solution.stats["num_steps"], solution.ys

    def abstract(shape: tuple, dtype: Any = np.float64) -> jax.ShapeDtypeStruct:
        return jax.ShapeDtypeStruct(shape, dtype)

    args = jax.tree.unflatten(args_tree, [abstract(*leaf) for leaf in args_leaves])
    size = int(np.prod(shape))
    return (
        jax.jit(run)
        .lower(
            abstract((size,)),
            args,
            abstract((times,)),
            abstract((jumps,)),
            abstract(()),
            abstract(()),
            abstract((), np.int64),
            abstract((times - 1,) if own_lengths else ()),
        )
        .compile()
    )
