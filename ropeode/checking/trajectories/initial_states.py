"""Whether trajectories begin where their problem does; if not, what they begin with instead."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ropeode.checking.trajectories.layout import Layout, samples_of
from ropeode.checking.trajectories.run_files import Run
from ropeode.checking.written_precision import epsilon, last_digit
from ropeode.errors import InputError
from ropeode.precision import in_float64
from ropeode.problems.problem import Problem
from ropeode.validation import complaint

# Units of rounding by which a first sample may be off: positions are often computed.
_ROUNDINGS = 4.0
# How much further than by its largest rate a step may lead, to be taken for the first one.
_ABOUT = 1.5


def check_initial_states(runs: Sequence[Run], problem: Problem) -> float:
    """See that the first sample of each run is the initial state.

    Arguments:
        runs: of the problem.
        problem: whose initial state it has to be.

    Returns:
        By how much any number is off.

    Raises:
        InputError: one line for each run that begins with another one.
    """
    layout, wanted = Layout.of(problem), samples_of(problem, problem.y0[None])[0]
    faults, largest = [], 0.0
    for run in runs:
        given = run.values[0]
        apart = np.abs(given - wanted[:, : given.shape[1]])
        off = apart > _allowed(run, layout, problem)
        largest = max(largest, float(np.max(apart)))
        if off.any():
            faults.append(_complaint(run, problem, layout, wanted, off))
    if faults:
        raise InputError(faults)
    return largest


def rounding_of(run: Run, layout: Layout) -> np.ndarray:
    """By how much the numbers of each column may be off as they are written, ``(columns,)``."""
    parts = np.split(run.values, range(layout.dim, run.values.shape[2], layout.dim), axis=2)
    return np.repeat([last_digit(part) for part in parts], layout.dim)


def _allowed(run: Run, layout: Layout, problem: Problem) -> np.ndarray:
    size = np.max(np.abs(run.values[0]), initial=problem.scale)
    rounding = _ROUNDINGS * epsilon(run.values) * size
    # Velocities may be differences of positions.
    columns = np.full(run.values.shape[2], rounding)
    columns[layout.dim :] = rounding / run.dt
    return columns + 2.0 * rounding_of(run, layout)


def _complaint(
    run: Run, problem: Problem, layout: Layout, wanted: np.ndarray, off: np.ndarray
) -> str:
    node, column = (int(i[0]) for i in np.nonzero(off))
    name = layout.columns(run.values.shape[2] > layout.dim)[column]
    cause, fix = _cause(run, problem, layout, wanted, off)
    return complaint(
        f"{run.path}, initial state, node {node} ({name})",
        float(run.values[0, node, column]),
        f"{wanted[node, column]:.9g}, as the problem says{cause}",
        fix,
    )


def _cause(
    run: Run, problem: Problem, layout: Layout, wanted: np.ndarray, off: np.ndarray
) -> tuple[str, str]:
    """What the file may begin with instead, and how to mend it."""
    given, dim = run.values[0], layout.dim
    wanted = wanted[:, : given.shape[1]]
    allowed = _allowed(run, layout, problem)

    def same(other: np.ndarray) -> bool:
        return bool((np.abs(given - other) <= allowed).all())

    if same(wanted[::-1]):
        return "; the nodes are in reverse order", "count nodes from the other end"
    if dim > 1 and same(wanted.reshape(len(wanted), -1, dim)[:, :, ::-1].reshape(wanted.shape)):
        return "; the coordinates are in reverse order", "write x before y"
    flips = np.where(np.arange(dim) == 1, -1.0, 1.0)
    if dim > 1 and same(wanted * np.tile(flips, given.shape[1] // dim)):
        return "; y points the other way", "let y point as in the spec"
    shift = given[:, :dim] - wanted[:, :dim]
    if not off[:, dim:].any() and np.ptp(shift, axis=0).max() <= 2.0 * allowed[:dim].max():
        return "; the whole state is shifted", "use the coordinates of the spec"
    if problem.mechanics is not None and _after_a_step(run, problem, layout):
        if not off[:, :dim].any():
            fix = "write velocities of the time of the positions, or leave them out"
            return "; the velocities are those of another time, as in leapfrog", fix
        return "; it seems to be the state after the first step", "write the initial state first"
    return "", "start from the state of the spec; `ropeode grade --init` writes it"


@in_float64
def _after_a_step(run: Run, problem: Problem, layout: Layout) -> bool:
    """Whether the first sample is as near the initial state as a first step can lead."""
    mechanics = problem.require_mechanics("initial state")
    x0, v0 = problem.y0
    rate = float(np.max(np.abs(mechanics.acceleration(problem.ts[0], x0, v0, problem.args))))
    columns = np.full(run.values.shape[2], _ABOUT * run.dt * rate)
    speed = float(np.max(np.abs(v0), initial=0.0))
    columns[: layout.dim] = _ABOUT * run.dt * (speed + run.dt * rate)
    apart = np.abs(run.values[0] - samples_of(problem, problem.y0[None])[0][:, : len(columns)])
    return bool((apart <= columns + _allowed(run, layout, problem)).all())
