"""Adaptive SciPy solvers: witnesses that share no code with the primary solver."""

from __future__ import annotations

import functools
import sys
import time
from collections.abc import Callable, Collection
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from scipy import integrate, sparse
from scipy.integrate import LSODA

from ropeode.errors import InputError
from ropeode.precision import in_float64
from ropeode.problems import Problem, PythonRhs, random_states
from ropeode.references.solvers.family import Family, abstract
from ropeode.references.solvers.rounding import change_if_asked
from ropeode.references.solvers.solution import Path, Solution, Stopwatch, finite_samples
from ropeode.references.solvers.solver import MOST_DENSE, SCIPY_BDF, Solver
from ropeode.validation import shortly

# SciPy warns about tolerances below 100 units of rounding and takes that.
_TIGHTEST_RTOL = 100 * np.finfo(np.float64).eps
# Columns of one call.
_COLUMNS = 256
# A Jacobian with more of its entries is factored as slowly as a dense one.
_DENSE = 0.05
_patterns: dict[tuple, Any] = {}
_MOST_KEPT = 8


@in_float64
def solve(
    problem: Problem,
    solver: Solver,
    rtol: float,
    atol: float | np.ndarray,
    *,
    max_steps: int = sys.maxsize,
    seconds: float = np.inf,
    longest_steps: np.ndarray | None = None,
    y0: np.ndarray | None = None,
    rounding_seed: int = 0,
    stops: Collection[float] = (),
    functions: tuple[Callable, Any] | None = None,
) -> Solution:
    """Solve with SciPy, each sample time being the end of a step.

    The solver is driven from one sample time (or jump time) to the next, because
    `solve_ivp` would interpolate. At a jump time it starts anew. Inside each piece the
    right-hand side is never evaluated on or beyond the piece's jumps.

    Arguments are those of `diffrax_solver.solve`; the solver is any that SciPy has, and steps end
    at `stops` too, which lie inside the span. Roundings are moved for large stiff problems only.
    `functions` are those of `functions_of`, where they have been compiled before.
    """
    started = time.perf_counter()
    field, jacobian = functions or functions_of(problem, solver.implicit, rounding_seed)
    compile_seconds = time.perf_counter() - started

    stopwatch = Stopwatch()
    shape, ts, jumps = problem.y0.shape, problem.ts, set(problem.jump_times)
    ends = sorted({*ts[1:], *jumps, *stops})
    first, last = ts[0], ts[-1]
    y = (problem.y0 if y0 is None else y0).reshape(-1)
    states = np.full((len(ts), *shape), np.nan)
    states[0] = y.reshape(shape)
    longest = np.full(len(ts) - 1, np.inf) if longest_steps is None else longest_steps
    flat_atol = np.broadcast_to(atol, shape).reshape(-1)
    steps, failure, run, sample, ran_out = 0, None, None, 1, False
    path, made = [], []
    method = getattr(integrate, solver.method)
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

                def slope(t: float, y: np.ndarray, low: float = low, high: float = high) -> Any:
                    return jacobian(min(max(t, low), high), y)

                jac = {}
                if solver.implicit:
                    jac = {"jac": slope} if callable(jacobian) else {"jac_sparsity": jacobian}
                run = method(inside, at, y, stop, rtol=rtol, atol=flat_atol, **jac)
                made.append(run)
            _go_on(run, stop, longest[sample - 1])
            while run.status == "running" and steps < max_steps and not ran_out:
                before, slope_before = run.t, getattr(run, "f", None)
                try:
                    message = run.step()
                except InputError:
                    # The user's right-hand side raised.
                    raise
                except (ValueError, np.linalg.LinAlgError) as error:
                    # A Jacobian that is not finite, or that cannot be inverted.
                    run.status, message = "failed", shortly(error)
                ran_out = stopwatch.seconds > seconds
                steps += 1
                if not np.all(np.isfinite(run.y)):
                    run.status, message = "failed", "the state is not finite"
                elif run.t > before and slope_before is not None:
                    path.append((run.t, run.y, slope_before, run.f))
            if run.status != "finished":
                reason = "its time was up" if ran_out else f"{max_steps} steps did not suffice"
                reason = message.rstrip(".") if run.status == "failed" and message else reason
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
        seconds=stopwatch.seconds,
        compile_seconds=compile_seconds,
        failure=failure,
        ran_out=failure is not None and (ran_out or steps >= max_steps),
        reached=float(run.t) if run else float(last),
        path=Path.of(first, states[0].reshape(-1), path),
        rhs_evaluations=sum(each.nfev for each in made),
        jacobian_evaluations=sum(int(each.njev) for each in made),
    )


def _go_on(run: Any, stop: float, longest: float) -> None:
    """Let a solver that has arrived go on to another time."""
    run.t_bound, run.status, run.max_step = stop, "running", longest
    if isinstance(run, LSODA):
        # The time that its Fortran code does not step over.
        run._lsoda_solver._integrator.rwork[0] = stop


def functions_of(problem: Problem, with_jacobian: bool, seed: int = 0) -> tuple[Callable, Any]:
    """The right-hand side on flat NumPy arrays, and its Jacobian, or the pattern of a large one.

    The problem's numbers are compiled in: converting them at each call took half its time. Not so
    where the state is large, and many runs share one program.
    """
    own = problem.rhs
    if with_jacobian and problem.y0.size > MOST_DENSE and not problem.in_python:
        program = _with_rounding(Family.of(problem, SCIPY_BDF, 1))
        numbers = jax.device_put((jax.tree.leaves(problem.args), seed))
        return lambda t, y: np.asarray(program(np.float64(t), y, *numbers)), sparsity(problem)
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


@functools.lru_cache(maxsize=16)
def _with_rounding(family: Family) -> Callable:
    def field(t: Any, y: Any, leaves: Any, seed: Any) -> Any:
        def at(y: Any) -> Any:
            return family.field(t, y, leaves)

        return at(y) + change_if_asked(at, y, seed)

    y, leaves, *_ = family.inputs()
    return jax.jit(field).lower(abstract(()), y, leaves, abstract((), np.int64)).compile()


@in_float64
def sparsity(problem: Problem) -> Any:
    """The pattern of a Jacobian at a few random states, as a sparse matrix of ones.

    A wrong pattern costs implicit solvers steps, and nothing of their accuracy: Newton's method
    finds the same root with another matrix, or none.

    Arguments:
        problem: with a right-hand side in JAX.

    Returns:
        None where the Jacobian is not sparse.
    """
    leaves = jax.tree.leaves(problem.args)
    family = Family.of(problem, SCIPY_BDF, 1)
    numbers = (problem.y0, problem.ts[[0, -1]], *leaves)
    key = family, *(np.asarray(each).tobytes() for each in numbers)
    if key not in _patterns:
        if len(_patterns) >= _MOST_KEPT:
            _patterns.clear()
        _patterns[key] = _pattern(problem, _columns(family), leaves)
    return _patterns[key]


def _pattern(problem: Problem, columns: Callable, leaves: Any) -> Any:
    size, found, total = problem.y0.size, [], 0
    for first in range(0, size, _COLUMNS):
        block = np.zeros((_COLUMNS, size), dtype=bool)
        for t, y in random_states(problem):
            block |= np.asarray(columns(t, y.reshape(-1), leaves, first))
        found.append(sparse.csr_array(block[: size - first]))
        total += found[-1].nnz
        if total > _DENSE * size**2:
            return None
    return sparse.csc_matrix(sparse.vstack(found).T, dtype=np.float64)


@functools.lru_cache(maxsize=16)
def _columns(family: Family) -> Callable:
    """A function that says of some columns, from a given one on, which entries are not zero."""

    def columns(t: Any, y: Any, leaves: Any, first: Any) -> Any:
        def column(index: Any) -> Any:
            direction = jnp.where(jnp.arange(y.size) == index, 1.0, 0.0)
            return jax.jvp(lambda y: family.field(t, y, leaves), (y,), (direction,))[1]

        # What is not a number may be anything.
        return jax.vmap(column)(first + jnp.arange(_COLUMNS)) != 0.0

    return jax.jit(columns)
