"""Whether trajectories begin with the initial state of their problem; if not, with what."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ropeode.checking.trajectories.layout import samples_of
from ropeode.checking.trajectories.run_files import Run
from ropeode.checking.written_precision import epsilon, last_digit
from ropeode.errors import InputError
from ropeode.precision import in_float64
from ropeode.validation import complaint

# Units of rounding by which a first sample may be off: programs often compute positions.
_ROUNDINGS = 4.0
# A first step may move the state by at most this many times its largest initial rate times dt.
_ABOUT = 1.5


def check_initial_states(runs: Sequence[Run]) -> float:
    """Check that the first sample of each run is the initial state.

    Returns:
        The largest error of any number.

    Raises:
        InputError: one line for each run that begins with another state.
    """
    faults, largest = [], 0.0
    for run in runs:
        error = np.abs(run.values[0] - _wanted(run))
        largest = max(largest, float(np.max(error)))
        if np.any(off := error > _allowed(run)):
            faults.append(_complaint(run, off))
    if faults:
        raise InputError(faults)
    return largest


def rounding_of(run: Run) -> np.ndarray:
    """The largest rounding error of the written numbers of each column, ``(columns,)``."""
    dim = run.layout.dim
    parts = np.split(run.values, range(dim, run.values.shape[2], dim), axis=2)
    return np.repeat([last_digit(part) for part in parts], dim)


def _wanted(run: Run) -> np.ndarray:
    """The initial state as the first sample of a file, ``(nodes, columns)``."""
    problem = run.problem
    return samples_of(problem, problem.y0[None])[0][:, : run.values.shape[2]]


def _allowed(run: Run) -> np.ndarray:
    size = np.max(np.abs(run.values[0]), initial=run.problem.scale)
    rounding = _ROUNDINGS * epsilon(run.values) * size
    # Velocities may be differences of positions.
    columns = np.full(run.values.shape[2], rounding)
    columns[run.layout.dim :] = rounding / run.dt
    return columns + 2.0 * rounding_of(run)


def _complaint(run: Run, off: np.ndarray) -> str:
    node, column = (int(i[0]) for i in np.nonzero(off))
    name = run.layout.columns(run.values.shape[2] > run.layout.dim)[column]
    cause, fix = _cause(run, off)
    return complaint(
        f"{run.path}, initial state, node {node} ({name})",
        float(run.values[0, node, column]),
        f"{_wanted(run)[node, column]:.9g}, the initial state of the problem{cause}",
        fix,
    )


def _cause(run: Run, off: np.ndarray) -> tuple[str, str]:
    """A likely cause of a wrong initial state, and how to mend it."""
    first, wanted, dim = run.values[0], _wanted(run), run.layout.dim
    allowed = _allowed(run)

    def same(other: np.ndarray) -> bool:
        return bool((np.abs(first - other) <= allowed).all())

    if same(wanted[::-1]):
        return "; the nodes are in reverse order", "number nodes from the other end"
    if dim > 1 and same(wanted.reshape(len(wanted), -1, dim)[:, :, ::-1].reshape(wanted.shape)):
        return "; the coordinates are in reverse order", "write x before y"
    flips = np.where(np.arange(dim) == 1, -1.0, 1.0)
    if dim > 1 and same(wanted * np.tile(flips, first.shape[1] // dim)):
        return "; y points the other way", "let y point in the direction of the spec"
    shift = first[:, :dim] - wanted[:, :dim]
    if not off[:, dim:].any() and np.ptp(shift, axis=0).max() <= 2.0 * allowed[:dim].max():
        return "; the whole state is shifted", "use the coordinates of the spec"
    if run.layout.mechanical and _after_a_step(run):
        if not off[:, :dim].any():
            fix = "write velocities at the time of the positions, or leave them out"
            return "; the velocities belong to another time, as in leapfrog", fix
        return "; it seems to be the state after the first step", "write the initial state first"
    return "", "start from the initial state of the spec; `ropeode grade --init` writes it"


@in_float64
def _after_a_step(run: Run) -> bool:
    """Whether the first sample is close enough to the initial state to be one step after it."""
    problem = run.problem
    mechanics = problem.require_mechanics("initial state")
    x0, v0 = problem.y0
    rate = float(np.max(np.abs(mechanics.acceleration(problem.ts[0], x0, v0, problem.args))))
    columns = np.full(run.values.shape[2], _ABOUT * run.dt * rate)
    speed = float(np.max(np.abs(v0), initial=0.0))
    columns[: run.layout.dim] = _ABOUT * run.dt * (speed + run.dt * rate)
    error = np.abs(run.values[0] - _wanted(run))
    return bool((error <= columns + _allowed(run)).all())
