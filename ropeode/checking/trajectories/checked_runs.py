"""Files of one program, read, with the likely mistake if they do not begin or sample right."""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ropeode.checking.trajectories.explanations import (
    explain,
    explain_start,
    times_complaint,
)
from ropeode.checking.trajectories.run_files import (
    FEWEST,
    Files,
    Run,
    finite,
    for_each_file,
    read_runs,
)
from ropeode.checking.trajectories.time_errors import late_samples
from ropeode.errors import InputError, ReferenceRefused
from ropeode.problems import Problem
from ropeode.progress import Progress
from ropeode.references import Reference
from ropeode.validation import complaint, not_traced

# How far off, as a part of the problem's size, a first sample in single precision is.
_SINGLE = 4.0 * float(np.finfo(np.float32).eps)
# Nodes in a row of which a distance can be told; and the number of the first, as people count.
_FEWEST_NODES, _FIRSTS = 3, (0.0, 1.0, 0.5)
_USUAL_FIX = "start from the initial state of the spec; `ropeode grade --init` writes it"


def checked_runs(
    files: Sequence[str | Path],
    problem: Problem,
    dts: Any,
    certified: Callable[[], Reference],
    progress: Progress,
    fewest: int = FEWEST,
) -> tuple[Run, ...]:
    """Read files, and check their first samples.

    Arguments:
        files: as `read_runs` has them.
        problem: likewise.
        dts: likewise.
        certified: makes the reference of the problem, which shows whether files are right but for
            one mistake.
        progress: as `read_runs` has it.
        fewest: likewise.

    Returns:
        The runs, from coarse to fine.

    Raises:
        InputError: they cannot be used; with the mistake that explains it, if there is one.
    """
    not_traced("dts", dts)
    asked = Files(files, problem, dts, fewest)
    try:
        runs = read_runs(files, problem, dts, progress, fewest=fewest)
    except InputError:
        with contextlib.suppress(ReferenceRefused):
            if (explanation := explain(certified, asked)) is not None:
                raise InputError(times_complaint(explanation, asked)) from None
        raise
    try:
        _check_initial_states(runs)
    except InputError:
        if why := _why(finite(runs) or runs, asked, certified):
            _check_initial_states(runs, *why)
        raise
    return runs


def _why(
    runs: Sequence[Run], files: Files, certified: Callable[[], Reference]
) -> tuple[str, str] | None:
    """What explains a wrong initial state, and how to mend it."""
    if all(np.all(run.values == run.values[0]) for run in runs):
        fix = "write a copy of the state, not the array that the next step overwrites"
        return "all rows of a file are the same", fix
    if all(np.all(run.first_errors <= _SINGLE * run.problem.scale) for run in runs):
        return "it is right in single precision", "compute it in double precision"
    if (placed := _misplaced_nodes(runs)) is not None:
        return placed
    with contextlib.suppress(ReferenceRefused):
        if (explanation := explain(certified, files, runs)) is not None:
            return explanation.line, explanation.fix
        if (late := late_samples(certified(), runs)) is not None:
            return late.line, late.remedy
    return explain_start(runs)


def _check_initial_states(runs: Sequence[Run], why: str = "", fix: str = _USUAL_FIX) -> None:
    """Check that the first sample of each run is the initial state.

    Arguments:
        runs: of one program.
        why: what explains another first sample, if that is known.
        fix: how to mend it.

    Raises:
        InputError: one line for each fault.
    """

    def check(index: int) -> None:
        if not (run := runs[index]).begins():
            raise InputError(_complaint(run, why, fix))

    for_each_file([run.path for run in runs], check)


def _misplaced_nodes(runs: Sequence[Run]) -> tuple[str, str] | None:
    """Nodes in a row at wrong equal distances, as where their number is taken for that of gaps.

    Returns:
        The mistake, and how to mend it.
    """
    dim, nodes = runs[0].layout.dim, runs[0].layout.nodes
    right = runs[0].initial[:, :dim]
    places, way = np.arange(nodes)[:, None], right[-1] - right[0]
    evenly = right[0] + way * places / max(nodes - 1, 1)
    if nodes < _FEWEST_NODES or np.any(np.abs(right - evenly) > runs[0].allowed_first_errors[:dim]):
        return None
    for first, gaps in itertools.product(_FIRSTS, (nodes, nodes + 1, nodes - 1, nodes - 2)):
        off = right[0] + way * (places + first) / gaps - right
        if np.any(off) and all(
            np.all(np.abs(run.values[0, :, :dim] - right - off) <= run.allowed_first_errors[:dim])
            and run.begins(slice(dim, None))
            for run in runs
        ):
            i = f"(i + {first:g})" if first else "i"
            return (
                f"the nodes are placed at {i}/{gaps} of the way in place of i/{nodes - 1}: "
                f"{nodes} nodes have {nodes - 1} gaps",
                "place node i at start + (end - start) * i / (num_nodes - 1)",
            )
    return None


def _complaint(run: Run, why: str, fix: str) -> str:
    off = run.first_errors > run.allowed_first_errors
    node, column = (int(i[0]) for i in np.nonzero(off))
    name = run.layout.columns(run.values.shape[2] > run.layout.dim)[column]
    return complaint(
        f"{run.path}, initial state, node {node} ({name})",
        float(run.values[0, node, column]),
        f"{run.initial[node, column]:.9g}, the initial state of the problem"
        + (f"; {why}" if why else ""),
        fix,
    )
