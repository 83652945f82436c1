"""Adaptive solvers: ropeode's primary one, and the peers, all behind one call."""

from __future__ import annotations

import dataclasses
import time
import warnings
from collections.abc import Callable
from typing import Any

import jax
import numpy as np
from scipy.integrate import odeint, solve_ivp

from against.right_hand_sides import Compiled
from against.timing import Peers
from ropeode import Problem
from ropeode.references import DOPRI8, RADAU9
from ropeode.references import Solver as ReferenceSolver
from ropeode.references import solve as solve_with

MOST_STEPS = 10**6
_SCIPY_TIGHTEST = 100 * np.finfo(np.float64).eps


class NotSolved(Exception):
    """The solver gave up, in its own words."""


@dataclasses.dataclass
class Solver:
    """One solver with its options.

    Arguments:
        by: whose.
        how: method and options.
        rhs: what its right-hand side is written in; "" where it takes the problem's own.
        solve: ``solve(rtol)`` gives the states, ``(times, *state)``; it may raise `NotSolved`.
            The absolute tolerance is `rtol` times the largest component of the initial state.
        count: ``count(rtol)`` gives the evaluations of the right-hand side, those for
            difference quotients included; None where there are none to count.
        prepare: called before runs at one tolerance that are timed; gives the seconds that it
            took, which are not part of a run.
        compile_seconds: that compiling took, where that was done once.
        tightest: the smallest tolerance that it takes.
    """

    by: str
    how: str
    rhs: str
    solve: Callable[[float], np.ndarray]
    count: Callable[[float], int] | None
    prepare: Callable[[float], float] = lambda rtol: 0.0
    compile_seconds: float = 0.0
    tightest: float = 1e-14


def _counted(rhs: Callable) -> tuple[Callable, list[int]]:
    calls = [0]

    def call(*inputs: Any) -> Any:
        calls[0] += 1
        return rhs(*inputs)

    return call, calls


def _shaped(problem: Problem, y: Any) -> np.ndarray:
    states = np.asarray(y).reshape(-1, *problem.y0.shape)
    if len(states) < len(problem.ts) or not np.all(np.isfinite(states)):
        raise NotSolved(f"{len(states)} of {len(problem.ts)} samples")
    return states


def primary(problem: Problem, method: ReferenceSolver) -> Solver:
    """Ropeode's solver of a reference, without what certifies it."""

    def solve(rtol: float, of: Problem = problem) -> np.ndarray:
        run = solve_with(of, method, rtol, rtol * of.scale, max_steps=MOST_STEPS)
        if run.failure:
            raise NotSolved(run.failure)
        return run.states

    def count(rtol: float) -> int:
        calls = [0]

        def tick() -> None:
            calls[0] += 1

        def rhs(t: Any, y: Any, args: Any) -> Any:
            jax.debug.callback(tick)
            return problem.rhs(t, y, args)

        solve(rtol, dataclasses.replace(problem, rhs=rhs))
        jax.effects_barrier()
        return calls[0]

    compiling = solve_with(problem, method, 1e-3, 1e-3, max_steps=10).compile_seconds
    return Solver("ropeode", f"primary: {method}", "", solve, count, compile_seconds=compiling)


def _with_rhs(
    by: str, how: str, compiled: Compiled, solve: Callable[[Callable, float], np.ndarray],
    tightest: float = 1e-14,
) -> Solver:  # fmt: skip
    def count(rtol: float) -> int:
        rhs, calls = _counted(compiled.rhs)
        solve(rhs, rtol)
        return calls[0]

    return Solver(
        by,
        how,
        compiled.name,
        lambda rtol: solve(compiled.rhs, rtol),
        count,
        compile_seconds=compiled.compile_seconds,
        tightest=tightest,
    )


def dop853(problem: Problem, compiled: Compiled) -> Solver:
    """`solve_ivp` as it is called by most: samples by `t_eval`."""
    y0, span = problem.y0.reshape(-1), (problem.ts[0], problem.ts[-1])

    def solve(rhs: Callable, rtol: float) -> np.ndarray:
        found = solve_ivp(
            rhs, span, y0, method="DOP853", t_eval=problem.ts, rtol=rtol, atol=rtol * problem.scale
        )
        return _shaped(problem, found.y.T)

    return _with_rhs("SciPy", "DOP853", compiled, solve, _SCIPY_TIGHTEST)


def lsoda(problem: Problem, compiled: Compiled) -> Solver:
    """`odeint`, which runs LSODA without leaving compiled code between steps."""
    y0 = problem.y0.reshape(-1)

    def solve(rhs: Callable, rtol: float) -> np.ndarray:
        y, info = odeint(
            rhs,
            y0,
            problem.ts,
            tfirst=True,
            full_output=True,
            rtol=rtol,
            atol=rtol * problem.scale,
            mxstep=MOST_STEPS,
        )
        if info["message"] != "Integration successful.":
            raise NotSolved(info["message"])
        return _shaped(problem, y)

    return _with_rhs("SciPy", "LSODA (odeint)", compiled, solve)


def cvode(problem: Problem, method: str, compiled: Compiled, peers: Peers) -> Solver:
    """CVODE by scikit-sundae; Jacobians by difference quotients, as for the others."""
    sundae = peers.get("sksundae", "scikit-sundae")
    y0 = problem.y0.reshape(-1)

    def solve(rhs: Callable, rtol: float) -> np.ndarray:
        def fill(t: float, y: np.ndarray, dy: np.ndarray) -> None:
            dy[:] = rhs(t, y)

        solver = sundae.cvode.CVODE(
            fill,
            method=method,
            linsolver="dense",
            rtol=rtol,
            atol=rtol * problem.scale,
            max_num_steps=MOST_STEPS,
        )
        found = solver.solve(problem.ts, y0)
        if not found.success:
            raise NotSolved(found.message)
        return _shaped(problem, found.y)

    return _with_rhs("scikit-sundae", f"CVODE {method}", compiled, solve)


def heyoka_equations(problem: Problem) -> list[tuple[Any, Any]]:
    """The equations in heyoka's own words."""
    import heyoka

    kind = problem.parameters["kind"]
    if kind == "rope":
        from extended import by_hand

        return by_hand(problem)
    if kind == "kepler":
        x, y, u, v = heyoka.make_vars("x", "y", "u", "v")
        cubed = (x * x + y * y) ** 1.5
        return [(x, u), (y, v), (u, -x / cubed), (v, -y / cubed)]
    x, v = heyoka.make_vars("x", "v")
    return [(x, v), (v, ((1.0 - x * x) * v - x) / float(problem.args))]


def taylor(problem: Problem, peers: Peers) -> Solver:
    """Heyoka in float64.

    While tolerances are tried it compiles in compact mode, which is quick; what is timed is
    compiled in its default mode, which runs faster.
    """
    heyoka = peers.get("heyoka", "heyoka")
    # It keeps what it has compiled in a folder, too; an earlier run is not to shorten this one.
    heyoka.llvm_state.set_diskcache_enabled(False)
    equations, y0 = heyoka_equations(problem), problem.y0.reshape(-1)
    ready: dict[float, Any] = {}

    def built(rtol: float, compact: bool) -> Any:
        return heyoka.taylor_adaptive(equations, y0.copy(), tol=rtol, compact_mode=compact)

    def prepare(rtol: float) -> float:
        heyoka.llvm_state.clear_memcache()
        started = time.perf_counter()
        ready[rtol] = built(rtol, compact=False)
        return time.perf_counter() - started

    def solve(rtol: float) -> np.ndarray:
        run = ready.get(rtol) or built(rtol, compact=True)
        run.time, run.state[:] = problem.ts[0], y0
        found = run.propagate_grid(problem.ts)
        return _shaped(problem, found[-1])

    return Solver("heyoka", "Taylor, float64", "", solve, None, prepare, tightest=1e-16)


Make = Callable[[Compiled], Solver]


def families(problem: Problem, *, stiff: bool, peers: Peers) -> list[list[Make]]:
    """For each peer its methods, given a right-hand side; ropeode's own and heyoka's take none.

    Of a peer's methods the fastest is raced. CVODE with GMRES in place of dense matrices is
    not tried: it was slower in most trials.
    """
    own = primary(problem, RADAU9 if stiff else DOPRI8)
    found: list[list[Make]] = [[lambda side: own], [lambda side: lsoda(problem, side)]]
    if stiff:
        peers.leave_out(f"SciPy DOP853 on {problem.name}", "it is explicit, and the problem stiff")
    else:
        found.append([lambda side: dop853(problem, side)])
    if peers.get("sksundae", "scikit-sundae"):
        found.append(
            [
                lambda side: cvode(problem, "BDF", side, peers),
                lambda side: cvode(problem, "Adams", side, peers),
            ]
        )
    if peers.get("heyoka", "heyoka"):
        series = taylor(problem, peers)
        found.append([lambda side: series])
    return found


def quietly(solver: Solver, rtol: float) -> np.ndarray | None:
    """States, or None where the solver gave up."""
    with warnings.catch_warnings():
        # Solvers warn of what they cannot do, which the error shows.
        warnings.simplefilter("ignore")
        try:
            return solver.solve(rtol)
        except NotSolved:
            return None
