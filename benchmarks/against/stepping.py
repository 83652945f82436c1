"""Steppers with constant steps: the same steps side by side, and the same true error."""

from __future__ import annotations

import functools
import time
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import diffrax
import jax
import numpy as np
from stepping import CPP_METHODS, NUMPY_STEPS, by_cpp

from against import jax_rope
from against.timing import Contender, Peers, clocked, race
from ropeode import Problem, Rope, load, simulate
from ropeode.norms import distance, norm_for

DIFFRAX = {
    "explicit-euler": diffrax.Euler(),
    "semi-implicit-euler": diffrax.SemiImplicitEuler(),
}
FRAMES = 1
# Positions are some hundreds and steps many thousands; what differs is where sums are rounded.
AGREEMENT = 1e-8
ORDER_2 = ("stormer-verlet", "velocity-verlet")


class Size(NamedTuple):
    """How much is run.

    Fields:
        nodes: of the one rope.
        methods: each with the damping of the rope.
        node_steps: nodes times steps of one run; a power of two, so that all sum up the same
            times.
        slow_node_steps: the same for NumPy.
        accuracy: the true error to reach.
        rounds: of each case.
        budget: seconds, after which a case makes no more than the fewest rounds.
    """

    nodes: tuple[int, ...] = (16, 256, 4096)
    methods: tuple[tuple[str, float], ...] = (
        ("explicit-euler", 0.01),
        ("semi-implicit-euler", 0.01),
        ("semi-implicit-euler", 0.0),
        ("verlet", 0.01),
    )
    node_steps: int = 2**20
    slow_node_steps: int = 2**16
    accuracy: float = 1e-4
    rounds: int = 9
    budget: float = 10.0


def numbers(problem: Problem) -> tuple:
    """The rope's numbers as the loops of `numba_rope` take them."""
    args = problem.args
    arrays = (args.stiffness, args.rest_length, args.damping, args.mass, args.gravity, args.free)
    return tuple(np.ascontiguousarray(array) for array in arrays)


class Work(NamedTuple):
    """One way to arrive at the final positions.

    Fields:
        by: whose.
        how: in a few words.
        run: ``run(steps)`` gives seconds and final positions, ``(2, nodes)``.
        slow: whether it gets fewer steps.
    """

    by: str
    how: str
    run: Callable[[int], tuple[float, np.ndarray]]
    slow: bool = False


def timed(work: Callable[[int], np.ndarray]) -> Callable[[int], tuple[float, np.ndarray]]:
    """`work` with the seconds of the whole call."""

    def run(steps: int) -> tuple[float, np.ndarray]:
        started = time.perf_counter()
        x = work(steps)
        return time.perf_counter() - started, x

    return run


def works(problem: Problem, method: str, peers: Peers, program: str | None) -> list[Work]:
    """Everyone's way to run a method; ropeode first."""
    stepper, args = CPP_METHODS[method], problem.args
    nodes, span = problem.y0.shape[-1], float(problem.frames)
    x0, v0 = problem.y0
    second = x0 if method == "verlet" else v0

    def by_ropeode(steps: int) -> np.ndarray:
        return simulate(problem, stepper, steps // problem.frames).states[-1, 0]

    def by_scan(steps: int) -> np.ndarray:
        step = jax_rope.STEPS[method]
        return np.asarray(jax_rope.scan(step, x0.T, second.T, span / steps, args, steps)).T

    def by_diffrax(steps: int) -> np.ndarray:
        ends = np.array([0.0, span])
        found = jax_rope.by_diffrax(DIFFRAX[method], x0.T, v0.T, span / steps, args, ends)
        return np.asarray(found)[-1].T

    def by_numpy(steps: int) -> np.ndarray:
        step, first, other = NUMPY_STEPS[stepper.split(":")[0]], x0, second
        for _ in range(steps):
            first, other = step(first, other, span / steps, args)
        return first

    found = [Work("ropeode", stepper, timed(by_ropeode))]
    damped = bool(np.any(args.damping))
    # The C++ program has the damping of the default rope.
    if program and damped:

        def by_program(steps: int) -> tuple[float, np.ndarray]:
            each, (_, *end) = by_cpp(program, nodes, method, steps, span / steps)
            return float(np.mean(each)) * steps * 1e-9, np.array(end)[:, None]

        found.append(Work("C++", "g++ -O3 -march=native", by_program))
    if peers.get("numba", "numba"):
        from against.numba_rope import STEPPERS

        def by_numba(steps: int) -> np.ndarray:
            return STEPPERS[method](x0, second, steps, span / steps, *numbers(problem))

        found.append(Work("Numba", "plain loop", timed(by_numba)))
    found.append(Work("lax.scan", "jitted, naive", timed(by_scan)))
    if method == "explicit-euler" or (method == "semi-implicit-euler" and not damped):
        how = f"{type(DIFFRAX[method]).__name__}, constant steps"
        found.append(Work("diffrax", how, timed(by_diffrax)))
    found.append(Work("NumPy", "vectorised over nodes", timed(by_numpy), slow=True))
    return found


def check(case: str, all_works: list[Work], steps: int) -> None:
    """All arrive at the same positions (C++: of the last node, and of the first rope).

    Raises:
        SystemExit: one does not.
    """
    _, known = all_works[0].run(steps)
    for work in all_works[1:]:
        _, x = work.run(steps)
        own = known[:, -x.shape[1] :][(..., *map(slice, x.shape[2:]))]
        apart = float(np.max(np.abs(x - own)))
        if not apart <= AGREEMENT:
            raise SystemExit(f"{case}: {work.by} ({work.how}) ends {apart:.1e} away from ropeode")


def same_steps(size: Size, peers: Peers, program: str | None) -> Iterator[dict[str, Any]]:
    """Nanoseconds per step where all make the same steps."""
    for nodes in size.nodes:
        for method, damping in size.methods:
            problem = Rope(num_nodes=nodes, damping=damping).problem(FRAMES)
            everyone = works(problem, method, peers, program)
            steps = max(size.node_steps // nodes, FRAMES)
            few = max(size.slow_node_steps // nodes, FRAMES)
            case = f"{method}, {nodes} nodes" + ("" if damping else ", undamped")
            check(case, everyone, steps)
            check(case, [work for work in everyone if work.slow or work.by == "ropeode"], few)

            def contender(work: Work, steps: int) -> Contender:
                return Contender(work.by, work.how, lambda: work.run(steps)[0] / steps)

            contenders = [contender(work, few if work.slow else steps) for work in everyone]
            yield {
                "part": "stepping",
                "case": case,
                "unit": "ns per step",
                "rows": race(contenders, size.rounds, budget=size.budget, scale=1e9),
            }


def step_counts() -> list[int]:
    """Steps per frame to try, from few to many, a factor of 1.2 or so apart."""
    return sorted({round(16 * 1.2**k) for k in range(40)})


def same_error(size: Size) -> dict[str, Any]:
    """Milliseconds to one true error, by methods of order 2 that do not step alike."""
    known = load("rope-damping-0.01")
    problem = Rope(damping=0.01).problem(20)
    truth, norm = known.states[: len(problem.ts)], norm_for(problem)
    x0, v0 = problem.y0

    def error(states: np.ndarray) -> float:
        return float(np.max(distance(problem, norm, states, truth)))

    def by_ropeode(stepper: str, n: int) -> np.ndarray:
        return simulate(problem, stepper, n).states

    def by_diffrax(n: int) -> np.ndarray:
        solver = diffrax.LeapfrogMidpoint()
        x = jax_rope.by_diffrax(solver, x0.T, v0.T, 1.0 / n, problem.args, problem.ts)
        # Velocities are not asked for; errors are of positions.
        return np.stack([np.swapaxes(np.asarray(x), 1, 2)] * 2, axis=1)

    contenders = []
    candidates = [(f"ropeode {name}", functools.partial(by_ropeode, name)) for name in ORDER_2]
    for name, work in [*candidates, ("diffrax LeapfrogMidpoint", by_diffrax)]:
        by, how = name.split()
        n = next((n for n in step_counts() if error(work(n)) <= size.accuracy), None)
        if n is None:
            raise SystemExit(f"{name} does not reach {size.accuracy:g}")
        facts = {"true_error": error(work(n)), "steps": n * problem.frames}
        contenders.append(Contender(by, how, clocked(functools.partial(work, n)), facts))
    return {
        "part": "true error",
        "case": f"default rope, 20 frames, true error <= {size.accuracy:g}",
        "unit": "ms",
        "rows": race(contenders, size.rounds, budget=size.budget, scale=1e3),
    }


def run(size: Size, peers: Peers, program: str | None) -> Iterator[dict[str, Any]]:
    """All cases of constant steps."""
    with jax.enable_x64(True):
        yield from same_steps(size, peers, program)
        yield same_error(size)
