"""A two-step method whose start is wrong, while its steps are right."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np

from ropeode.analysis import ObservedOrder, distances
from ropeode.checking.report import Diagnosis
from ropeode.checking.trajectories.convergence import order_finding
from ropeode.checking.trajectories.known_methods import VERLET_START
from ropeode.checking.trajectories.run_files import Run
from ropeode.checking.trajectories.time_errors import RUNS, explains
from ropeode.errors import ReferenceRefused
from ropeode.norms import NORMS
from ropeode.problems import Problem
from ropeode.progress import silent
from ropeode.references import Reference
from ropeode.simulation import simulate
from ropeode.theory import Expansion, derivative_of_rhs, projected

_EXPLAINED, _CLOSE = 1e-2, 1e-2
# A start explains runs that are so many times nearer to the motion from it.
_NEARER = 10.0
# Positions that converge with less than this are not of order 2.
_SECOND = 1.5
# A method of high order, and its steps per frame, that soon show whether a start may explain runs.
_TRIED, _STEPS = "dormand-prince8", 64
# The first step of Verlet's method, as people write it, by how many steps of acceleration it adds
# to the initial velocity.
_FIRST_STEPS = {
    0.5: (
        "x(-dt) = x(0) - dt v(0), without the acceleration, as semi-implicit Euler and a velocity "
        "that begins with a whole step do, too"
    ),
    -0.5: (
        "x(dt) = x(0) + dt v(0), without the acceleration (explicit Euler moves so, too, while "
        "forces hardly change)"
    ),
}


def diagnose_start(expansions: Sequence[Expansion], expected: int) -> Diagnosis | None:
    """What a start, or the state that is handed out, is off by below the expected order.

    Returns:
        None if the steps are off by no less, or the difference is none that is known.
    """
    if all(each.one_step for each in expansions):
        return None
    for order in range(-1, expected):
        if any(np.any(each.start(order).known) for each in expansions):
            break
        if any(np.any(each.rate(order).known) for each in expansions):
            return None
    else:
        return None
    starts = np.concatenate([each.start(order).value for each in expansions])
    slopes = np.concatenate([each.slopes for each in expansions])
    v, a = slopes[:, 0].ravel(), slopes[:, 1].ravel()
    of_x, of_v = (projected(starts[:, half].ravel(), np.stack([v, a])) for half in (0, 1))
    size = float(np.max(np.abs(starts)))
    if max(of_x.rest, of_v.rest) > _EXPLAINED * size:
        if order < 1 or _is_handed_out(expansions, order):
            return None
        line = (
            f"the start of the method is of order {order}: it leaves an error of dt^{order}, which "
            "the steps that follow only carry on; by themselves they are of a higher order"
        )
        remedy = f"make the first steps by a method of order {expected - 1} or higher"
        return Diagnosis("start", line, {"order": order}, remedy)
    evidence = {
        "order": order,
        **{
            quantity: dict(zip(("velocity", "acceleration"), map(float, of), strict=True))
            for quantity, of in (
                ("positions", of_x.coefficients),
                ("velocities", of_v.coefficients),
            )
        },
    }
    dt = f" dt^{order}" if order > 1 else " dt" if order else ""
    small = _CLOSE * max(float(np.max(np.abs(each.coefficients))) for each in (of_x, of_v))
    texts = [
        f"{quantity} are off by {value:.3g}{dt} times the {name}"
        for quantity in ("positions", "velocities")
        for name, value in evidence[quantity].items()
        if abs(value) > small
    ]
    if _is_handed_out(expansions, order):
        late = {"positions": of_x.coefficients[0], "velocities": of_v.coefficients[1]}
        if order == 1:
            texts = [
                f"{quantity} are those of {abs(by):.3g} dt {'later' if by > 0 else 'earlier'}"
                for quantity, by in late.items()
                if abs(by) > small
            ]
        line = (
            f"the state that is handed out is of order {order}, while the steps are of a higher "
            f"one: its {' and its '.join(texts)}"
        )
        return Diagnosis("output", line, evidence, "hand out positions and velocities of one time")
    if order == 0 and texts == ["velocities are off by -1 times the velocity"]:
        what = "it forgets the initial velocity, as x(-dt) = x(0) does"
    else:
        what = " and ".join(texts)
    line = f"the start of the method is of order {order}: {what}"
    return Diagnosis("start", line, evidence, VERLET_START)


def diagnose_start_of_runs(
    reference: Reference,
    runs: Sequence[Run],
    order: ObservedOrder,
    certified: Callable[[Problem], Reference],
) -> Diagnosis | None:
    """A wrong initial velocity from which the steps of runs are right.

    Arguments:
        reference: of the problem.
        runs: from coarse to fine.
        order: of their positions.
        certified: makes the reference of a problem.
    """
    problem = reference.problem
    if problem.mechanics is None:
        return None
    try:
        if order.verdict != "converges":
            return _forgotten(reference, runs, certified) if np.any(problem.y0[1]) else None
        low = order.observed is not None and order.observed < _SECOND
        return _first_step(reference, runs, certified) if low else None
    except ReferenceRefused:
        return None


def _from(problem: Problem, velocity: np.ndarray) -> Problem:
    """The same problem with another initial velocity, whose exact solution is not known."""
    return problem.changed(y0=np.stack([problem.y0[0], velocity]), exact=None)


def _off(run: Run, reference: Reference) -> float:
    norm = NORMS[f"{reference.problem.quantities[0]}-max"]
    return float(np.max(distances(run.states, reference, norm)))


def _forgotten(
    reference: Reference, runs: Sequence[Run], certified: Callable[[Problem], Reference]
) -> Diagnosis | None:
    """Runs of the problem that begin at rest, where it begins in motion."""
    problem, finest = reference.problem, runs[-1]
    rest = _from(problem, np.zeros_like(problem.y0[1]))
    own = _off(finest, reference)
    tried = simulate(rest, _TRIED, _STEPS, progress=silent)
    seen = dataclasses.replace(reference, problem=rest, states=tried.states)
    if tried.status != "ok" or own < _NEARER * _off(finest, seen):
        return None
    other = certified(rest)
    first = finest.values[0].copy()
    first[:, finest.layout.dim :] = 0.0
    theirs = [
        dataclasses.replace(run, problem=rest, values=np.concatenate([first[None], run.values[1:]]))
        for run in runs
    ]
    finding, _ = order_finding(other, theirs, None)
    if finding.status != "pass" or own < _NEARER * _off(finest, other):
        return None
    line = (
        "the initial velocity is forgotten, as where the first step begins with the last position "
        f"at the first one, x(-dt) = x(0): against the same problem from rest, {finding.line}"
    )
    return Diagnosis("start", line, {"error": own, "from_rest": _off(finest, other)}, VERLET_START)


def _first_step(
    reference: Reference, runs: Sequence[Run], certified: Callable[[Problem], Reference]
) -> Diagnosis | None:
    """Runs that begin with half a step of acceleration too much, or too little."""
    problem, half = reference.problem, 0.5 * runs[-1].dt
    a = np.asarray(problem.rhs(problem.ts[0], problem.y0, problem.args))[1]
    other = certified(_from(problem, problem.y0[1] + half * a))
    trusted = min(reference.trusted, other.trusted)
    # How far the positions are moved by the acceleration in the initial velocity, per dt.
    slope = ((other.states - reference.states) / half)[:trusted, 0]
    fine = [*runs[: -1 - RUNS : -1]]
    errors = [(run.states[:trusted] - reference.states[:trusted])[:, 0] for run in fine]
    for steps, words in _FIRST_STEPS.items():
        parts = [
            float(np.max(np.abs(error - steps * run.dt * slope)) / np.max(np.abs(error)))
            for run, error in zip(fine, errors, strict=True)
        ]
        if explains(parts, [run.dt for run in fine]):
            line = (
                f"the first step is {words}; so the positions are those of a method of higher "
                f"order that begins with v(0) {'+' if steps > 0 else '-'} dt/2 a(0), which "
                f"explains {100.0 * (1.0 - parts[0]):.3g}% of their errors at dt = {fine[0].dt:.4g}"
            )
            return Diagnosis(
                "start", line, {"left_over": parts[0], "velocity": steps}, VERLET_START
            )
    return None


def _is_handed_out(expansions: Sequence[Expansion], order: int) -> bool:
    """Whether a difference stays as it is, and does not move on as the solution's derivative does.

    An error of the start moves on like a disturbance of the state: its rate is f_y times itself.
    """
    for each in expansions:
        start, rate = each.start(order).value, each.rate(order).value
        carried = derivative_of_rhs(each.problem)(each.t, each.y, start)
        size = float(np.max(np.abs(carried)))
        if np.max(np.abs(rate - carried)) > _EXPLAINED * size:
            return True
    return False
