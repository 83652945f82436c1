"""Many ropes at once, each with a damping and a stiffness of its own, on all cores."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import jax
import numpy as np
from stepping import CPP_METHODS, NUMPY_STEPS

from against import jax_rope
from against.stepping import DIFFRAX, Work, check, timed
from against.timing import Contender, Peers, race
from ropeode import Rope, simulate
from ropeode.problems import Ensemble

NODES = 16
METHODS = ("explicit-euler", "semi-implicit-euler")


class Size(NamedTuple):
    """How much is run.

    Fields:
        ropes: in each case.
        rope_steps: ropes times steps of one run; a power of two.
        slow_rope_steps: the same for NumPy.
        methods: of `METHODS`.
        rounds: of each case.
        budget: seconds, after which a case makes no more than the fewest rounds.
    """

    ropes: tuple[int, ...] = (64, 1024, 16384)
    rope_steps: int = 2**20
    slow_rope_steps: int = 2**17
    methods: tuple[str, ...] = METHODS
    rounds: int = 9
    budget: float = 10.0


def ensemble(ropes: int) -> Ensemble:
    """The first is the default rope, which the C++ program knows."""
    draw = np.random.default_rng(1)
    damping = np.append(0.01, draw.uniform(0.0, 0.1, ropes - 1))
    stiffness = np.append(100.0, draw.uniform(50.0, 150.0, ropes - 1))
    return Rope(num_nodes=NODES).ensemble(1, damping=damping, stiffness=stiffness)


def works(given: Ensemble, method: str, peers: Peers, program: str | None) -> list[Work]:
    """Everyone's way to run a method; ropeode first. Positions are ``(2, nodes, ropes)``."""
    own = given.numbers(0, len(given))
    # For loops over ropes and for `vmap`: a rope's numbers lie together.
    first = jax.tree.map(lambda leaf: np.ascontiguousarray(np.moveaxis(leaf, -1, 0)), own)
    x0, v0 = first.y0[:, 0], first.y0[:, 1]
    in_rows = [np.ascontiguousarray(np.swapaxes(each, 1, 2)) for each in (x0, v0)]
    ends = np.array([0.0, 1.0])

    def last(x: Any) -> np.ndarray:
        return np.moveaxis(np.asarray(x), 0, -1)

    def by_ropeode(steps: int) -> np.ndarray:
        return simulate(given, CPP_METHODS[method], steps).states[-1, 0]

    def by_scan(steps: int) -> np.ndarray:
        step = jax_rope.STEPS[method]
        x = jax_rope.scan_many(step, *in_rows, 1.0 / steps, first.args, steps)
        return np.swapaxes(last(x), 0, 1)

    def by_diffrax(steps: int) -> np.ndarray:
        solver = DIFFRAX[method]
        x = jax_rope.many_by_diffrax(solver, *in_rows, 1.0 / steps, first.args, ends)
        return np.swapaxes(last(x[:, -1]), 0, 1)

    def by_numpy(steps: int) -> np.ndarray:
        x, v = own.y0
        for _ in range(steps):
            x, v = NUMPY_STEPS[method](x, v, 1.0 / steps, own.args)
        return x

    found = [Work("ropeode", "simulate(ensemble)", timed(by_ropeode))]
    if program:
        found.append(Work("C++", "one process per core", by_processes(program, method, given)))
    if peers.get("numba", "numba"):
        from against.numba_rope import STEPPERS, in_parallel

        run = in_parallel(STEPPERS[method])
        args = first.args
        numbers = (args.stiffness, args.rest_length, args.damping, args.mass, args.gravity)

        def by_numba(steps: int) -> np.ndarray:
            return last(run(x0, v0, steps, 1.0 / steps, *numbers, args.free))

        found.append(Work("Numba", "prange over ropes", timed(by_numba)))
    found.append(Work("lax.scan", "jit(vmap), naive", timed(by_scan)))
    if method == "explicit-euler":
        found.append(Work("diffrax", "jit(vmap), Euler, constant steps", timed(by_diffrax)))
    found.append(Work("NumPy", "vectorised over nodes and ropes", timed(by_numpy), slow=True))
    return found


def by_processes(program: str, method: str, given: Ensemble) -> Callable:
    """The C++ loop, which has one rope: as many steps as all ropes make, on each core a share."""
    cores = os.cpu_count() or 1

    def run(steps: int) -> tuple[float, np.ndarray]:
        repeats = max(len(given) // cores, 1)
        command = [program, method, str(NODES), str(steps), repr(1.0 / steps), str(repeats)]
        started = [
            subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(cores)
        ]
        outputs = [process.communicate()[0].split() for process in started]
        ends = [words.index("sum") for words in outputs]
        # As long as the slowest; starting the process is not counted.
        per_step = max(
            sum(map(float, words[1:end])) / repeats
            for words, end in zip(outputs, ends, strict=True)
        )
        position = np.array(list(map(float, outputs[0][ends[0] + 3 :])))
        return per_step * 1e-9 * len(given) * steps / cores, position[:, None, None]

    return run


def run(size: Size, peers: Peers, program: str | None) -> Iterator[dict[str, Any]]:
    """Nanoseconds per rope and step, all cores at work."""
    with jax.enable_x64(True):
        yield from _cases(size, peers, program)


def _cases(size: Size, peers: Peers, program: str | None) -> Iterator[dict[str, Any]]:
    for ropes in size.ropes:
        given = ensemble(ropes)
        for method in size.methods:
            everyone = works(given, method, peers, program)
            steps = max(size.rope_steps // ropes, 1)
            few = max(size.slow_rope_steps // ropes, 1)
            case = f"{method}, {ropes} ropes of {NODES} nodes"
            check(case, everyone, steps)
            check(case, [work for work in everyone if work.slow or work.by == "ropeode"], few)

            def contender(work: Work, steps: int, ropes: int) -> Contender:
                return Contender(work.by, work.how, lambda: work.run(steps)[0] / steps / ropes)

            contenders = [contender(work, few if work.slow else steps, ropes) for work in everyone]
            yield {
                "part": "many ropes",
                "case": case,
                "unit": "ns per rope-step",
                "rows": race(contenders, size.rounds, budget=size.budget, scale=1e9),
            }
