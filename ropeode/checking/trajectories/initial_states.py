"""Whether trajectories begin with the initial state of their problem."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from ropeode.checking.trajectories.layout import samples_of
from ropeode.checking.trajectories.run_files import Run, for_each_file
from ropeode.errors import InputError
from ropeode.validation import complaint

# Units of rounding by which a first sample may be off: programs often compute positions.
_ROUNDINGS = 4.0
_FLOAT32 = float(np.finfo(np.float32).eps)
# Nodes in a row of which a distance can be told; and the number of the first, as people count.
_FEWEST_NODES, _FIRSTS = 3, (0.0, 1.0, 0.5)
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

    def error_of(index: int) -> float:
        run = runs[index]
        error = first_errors(run)
        if np.any(off := error > allowed_first_errors(run)):
            raise InputError(_complaint(run, off, why, fix))
        return float(np.max(error))

    return max(for_each_file([run.path for run in runs], error_of), default=0.0)


def misplaced_nodes(runs: Sequence[Run]) -> tuple[str, str] | None:
    """Nodes in a row at wrong equal distances, as where their number is taken for that of gaps.

    Returns:
        The mistake, and how to mend it.
    """
    dim, nodes = runs[0].layout.dim, runs[0].layout.nodes
    right = _wanted(runs[0])[:, :dim]
    places, way = np.arange(nodes)[:, None], right[-1] - right[0]
    most = [allowed_first_errors(run) for run in runs]
    evenly = right[0] + way * places / max(nodes - 1, 1)
    if nodes < _FEWEST_NODES or np.any(np.abs(right - evenly) > most[0][:dim]):
        return None
    for first, gaps in itertools.product(_FIRSTS, (nodes, nodes + 1, nodes - 1, nodes - 2)):
        off = right[0] + way * (places + first) / gaps - right
        if np.any(off) and all(
            np.all(np.abs(run.values[0, :, :dim] - right - off) <= allowed[:dim])
            and np.all(first_errors(run)[:, dim:] <= allowed[dim:])
            for run, allowed in zip(runs, most, strict=True)
        ):
            i = f"(i + {first:g})" if first else "i"
            return (
                f"the nodes are placed at {i}/{gaps} of the way in place of i/{nodes - 1}: "
                f"{nodes} nodes have {nodes - 1} gaps",
                "place node i at start + (end - start) * i / (num_nodes - 1)",
            )
    return None


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
