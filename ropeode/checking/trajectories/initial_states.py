"""Whether trajectories begin with the initial state of their problem."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ropeode.checking.trajectories.layout import samples_of
from ropeode.checking.trajectories.run_files import Run, each_once
from ropeode.errors import InputError
from ropeode.validation import complaint

# Units of rounding by which a first sample may be off: programs often compute positions.
_ROUNDINGS = 4.0
_FLOAT32 = float(np.finfo(np.float32).eps)
_USUAL_FIX = "start from the initial state of the spec; `ropeode grade --init` writes it"


def check_initial_states(runs: Sequence[Run], why: str = "", fix: str = _USUAL_FIX) -> float:
    """Check that the first sample of each run is the initial state.

    Arguments:
        runs: of one program.
        why: what explains another first sample, if that is known.
        fix: how to mend it.

    Returns:
        The largest error of any number.

    Raises:
        InputError: one line for each fault.
    """
    faults, largest = [], 0.0
    for run in runs:
        error = first_errors(run)
        largest = max(largest, float(np.max(error)))
        if np.any(off := error > allowed_first_errors(run)):
            faults.append((run.path, _complaint(run, off, why, fix)))
    if faults:
        raise InputError(each_once(faults))
    return largest


def begins_right(runs: Sequence[Run], columns: slice) -> bool:
    """Whether the first samples of these columns are those of the initial state."""
    return all(
        np.all(first_errors(run)[:, columns] <= allowed_first_errors(run)[columns]) for run in runs
    )


def begins_in_single_precision(runs: Sequence[Run]) -> bool:
    """Whether the first samples are those of the initial state, but for rounding to float32."""
    allowed = _ROUNDINGS * _FLOAT32
    return all(np.all(first_errors(run) <= allowed * run.problem.scale) for run in runs)


def first_errors(run: Run) -> np.ndarray:
    """The error of each number of the first sample, ``(nodes, columns)``."""
    return np.abs(run.values[0] - _wanted(run))


def _wanted(run: Run) -> np.ndarray:
    """The initial state as the first sample of a file, ``(nodes, columns)``."""
    problem = run.problem
    return samples_of(problem, problem.y0[None])[0][:, : run.values.shape[2]]


def allowed_first_errors(run: Run) -> np.ndarray:
    """How far the numbers of each column of the first sample may be off, ``(columns,)``."""
    size = np.max(np.abs(run.values[0]), initial=run.problem.scale)
    rounding = _ROUNDINGS * run.epsilon * size
    # Velocities may be differences of positions.
    columns = np.full(run.values.shape[2], rounding)
    columns[run.layout.dim :] = rounding / run.dt
    return columns + 2.0 * run.rounding


def _complaint(run: Run, off: np.ndarray, why: str, fix: str) -> str:
    node, column = (int(i[0]) for i in np.nonzero(off))
    name = run.layout.columns(run.values.shape[2] > run.layout.dim)[column]
    return complaint(
        f"{run.path}, initial state, node {node} ({name})",
        float(run.values[0, node, column]),
        f"{_wanted(run)[node, column]:.9g}, the initial state of the problem"
        + (f"; {why}" if why else ""),
        fix,
    )
