"""A convergence study: `accuracy_table` and NodePy's `ctest`, on the same steps of RK4."""

from __future__ import annotations

import dataclasses
import functools
import os
from collections.abc import Iterator
from typing import Any, NamedTuple

import jax
import numpy as np

from against import right_hand_sides
from against.timing import Contender, Peers, clocked, race
from ropeode import Rope, accuracy_table, load, simulate
from ropeode.norms import distance, norm_for


class Size(NamedTuple):
    """How much is run.

    Fields:
        frames: of the default rope.
        steps_per_frame: the ladder.
        rounds: of each.
        budget: seconds, after which no more than the fewest rounds are made.
    """

    frames: int = 5
    steps_per_frame: tuple[int, ...] = (16, 32, 64, 128, 256, 512)
    rounds: int = 5
    budget: float = 10.0


def run(size: Size, peers: Peers) -> Iterator[dict[str, Any]]:
    """The study by both, what each reports, and what is true."""
    # ctest draws a figure, which must not open a window.
    os.environ.setdefault("MPLBACKEND", "Agg")
    with jax.enable_x64(True):
        yield _study(size, peers)


def _study(size: Size, peers: Peers) -> dict[str, Any]:
    problem = Rope(damping=0.01).problem(size.frames)
    truth, norm = load("rope-damping-0.01").states[: size.frames + 1], norm_for(problem)
    study = functools.partial(accuracy_table, problem, ["rk4"], size.steps_per_frame)
    table = study()
    reports = []
    for row in table.rows:
        states = simulate(problem, "rk4", row.steps_per_frame).states
        reports.append(
            {
                "steps_per_frame": row.steps_per_frame,
                "ropeode": row.error_max,
                "ropeode_resolution": row.resolution,
                "ropeode_true": float(np.max(distance(problem, norm, states, truth))),
            }
        )
    contenders = [Contender("ropeode", "accuracy_table, its reference included", clocked(study))]
    known = table.reference
    again = functools.partial(accuracy_table, known, ["rk4"], size.steps_per_frame)
    contenders.append(Contender("ropeode", "accuracy_table of a reference", clocked(again)))
    if peers.get("nodepy.convergence", "nodepy"):
        nodepy, reported = _nodepy(size, problem, truth, peers)
        contenders.append(nodepy)
        for report, more in zip(reports, reported, strict=True):
            report.update(more)
    order = table.orders[0].order
    return {
        "part": "study",
        "case": f"RK4 on the default rope, {size.frames} frames, "
        f"{size.steps_per_frame[0]} to {size.steps_per_frame[-1]} steps per frame",
        "unit": "s",
        "rows": race(contenders, size.rounds, budget=size.budget),
        "reports": reports,
        "order": dataclasses.asdict(order),
    }


def _nodepy(
    size: Size, problem: Any, truth: np.ndarray, peers: Peers
) -> tuple[Contender, list[dict[str, float]]]:
    """NodePy's study, and for each step size the error that it tells and the true one.

    It has no exact solution to go by, and makes itself one, as for any such problem. Its error
    is the 2-norm of the final state's.
    """
    from nodepy import convergence, ivp, rk

    side = right_hand_sides.quickest_first(problem, peers)[0]
    calls = [0]

    def rhs(t: float, y: np.ndarray) -> np.ndarray:
        calls[0] += 1
        return side.rhs(t, y)

    method = rk.loadRKM("RK44")
    given = ivp.IVP(f=rhs, u0=problem.y0.reshape(-1).copy(), T=float(problem.ts[-1]))
    grids = [n * size.frames for n in size.steps_per_frame]

    def study() -> list[float]:
        _, errors = convergence.ctest(method, given, grids=grids)
        return errors[0]

    told, evaluations = study(), calls[0]
    reported = []
    for error, steps in zip(told, grids, strict=True):
        end = method(given, N=steps)[1][-1]
        true = float(np.linalg.norm(end - truth[-1].reshape(-1)))
        reported.append({"nodepy": float(error), "nodepy_true": true})
    facts = {"evaluations": evaluations, "rhs": side.name}
    return Contender("NodePy", "convergence.ctest", clocked(study), facts), reported
