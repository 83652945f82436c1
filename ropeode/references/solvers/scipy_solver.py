"""Adaptive SciPy solvers: witnesses that share no code with the primary solver."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection
from typing import Any

import jax
import numpy as np
from scipy.integrate import DOP853, Radau

from ropeode.precision import in_float64
from ropeode.problems.problem import Problem
from ropeode.problems.python_rhs import PythonRhs
from ropeode.references.solvers.solution import Path, Solution, finite_samples
from ropeode.references.solvers.solver import SCIPY_DOP853, SCIPY_RADAU, Solver

# SciPy warns about tolerances below 100 units of rounding and takes that.
_TIGHTEST_RTOL = 100 * np.finfo(np.float64).eps

SOLVERS: dict[Solver, Callable[..., DOP853 | Radau]] = {SCIPY_DOP853: DOP853, SCIPY_RADAU: Radau}


@in_float64
def solve(
    problem: Problem,
    solver: Solver,
    rtol: float,
    atol: float,
    *,
    max_steps: int,
    stops: Collection[float] = (),
) -> Solution:
    """Solve with SciPy, each sample time being the end of a step.

    The solver is driven from one sample time (or jump time) to the next, because
    `solve_ivp` would interpolate. At a jump time it starts anew. Inside each piece the
    right-hand side is never evaluated on or beyond the piece's jumps.

    Arguments are those of `diffrax_solver.solve`; the solver is one of `SOLVERS`, and steps end
    at `stops` too, which lie inside the span.
    """
    started = time.perf_counter()
    field, jacobian = _compiled(problem, with_jacobian=solver.implicit)
    compile_seconds = time.perf_counter() - started

    started = time.perf_counter()
    shape, ts, jumps = problem.y0.shape, problem.ts, set(problem.jump_times)
    ends = sorted({*ts[1:], *jumps, *stops})
    first, last = ts[0], ts[-1]
    y = problem.y0.reshape(-1)
    states = np.full((len(ts), *shape), np.nan)
    states[0] = problem.y0
    steps, failure, run, sample = 0, None, None, 1
    path = []
    rtol = max(rtol, _TIGHTEST_RTOL)
    with np.errstate(all="ignore"):
        for i, stop in enumerate(ends):
            if run is None:
                at = first if i == 0 else ends[i - 1]
                # The piece between two jumps, open at both ends.
                low = np.nextafter(at, np.inf) if at in jumps else at
                end = next((s for s in ends[i:] if s in jumps), last)
                high = np.nextafter(end, -np.inf) if end in jumps else end

                def inside(
                    t: float, y: np.ndarray, low: float = low, high: float = high
                ) -> np.ndarray:
                    return field(min(max(t, low), high), y)

                def slope(
                    t: float, y: np.ndarray, low: float = low, high: float = high
                ) -> np.ndarray:
                    return jacobian(min(max(t, low), high), y)

                jac = {"jac": slope} if solver.implicit else {}
                run = SOLVERS[solver](inside, at, y, stop, rtol=rtol, atol=atol, **jac)
            run.t_bound, run.status = stop, "running"
            while run.status == "running" and steps < max_steps:
                before, slope_before = run.t, run.f
                message = run.step()
                steps += 1
                if not np.all(np.isfinite(run.y)):
                    run.status, message = "failed", "the state is not finite"
                elif run.t > before:
                    path.append((run.t, run.y, slope_before, run.f))
            if run.status != "finished":
                reason = message if run.status == "failed" else f"{max_steps} steps did not suffice"
                failure = f"stopped after t = {run.t:g}: {reason}"
                break
            y = run.y
            if stop == ts[sample]:
                states[sample] = y.reshape(shape)
                sample += 1
            if stop in jumps:
                run = None
    return Solution(
        solver=solver,
        rtol=rtol,
        atol=atol,
        states=states[: finite_samples(states)],
        steps=steps,
        seconds=time.perf_counter() - started,
        compile_seconds=compile_seconds,
        failure=failure,
        reached=float(run.t) if run else float(last),
        path=Path.of(first, states[0].reshape(-1), path),
    )


def _compiled(problem: Problem, *, with_jacobian: bool) -> tuple[Callable, Callable]:
    """The right-hand side on flat NumPy arrays, and its Jacobian.

    The problem's numbers are compiled in: converting them at each call took half its time.
    """
    own = problem.rhs
    if isinstance(own, PythonRhs):
        return (
            lambda t, y: own.evaluated(float(t), y, problem.args),
            lambda t, y: own.slopes(float(t), y, problem.args),
        )

    def field(t: Any, y: Any) -> Any:
        return problem.rhs(t, y.reshape(problem.y0.shape), problem.args).reshape(-1)

    def numpy_function(function: Callable) -> Callable:
        compiled = jax.jit(function).lower(np.float64(0.0), problem.y0.reshape(-1)).compile()
        return lambda t, y: np.asarray(compiled(np.float64(t), y))

    slope = numpy_function(jax.jacfwd(field, argnums=1)) if with_jacobian else field
    return numpy_function(field), slope
