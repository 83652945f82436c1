"""Files of one program, read, with the likely mistake if they do not begin or sample right."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ropeode.checking.trajectories.explanations import explain, times_complaint, why_start
from ropeode.checking.trajectories.run_files import (
    FEWEST,
    Files,
    Run,
    finite,
    for_each_file,
    read_runs,
)
from ropeode.errors import InputError, ReferenceRefused
from ropeode.problems import Problem
from ropeode.progress import Progress
from ropeode.references import Reference
from ropeode.validation import complaint, not_traced

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
    if all(run.begins() for run in runs):
        return runs
    why, fix = why_start(certified, asked, finite(runs) or runs) or ("", _USUAL_FIX)

    def check(index: int) -> None:
        if not runs[index].begins():
            raise InputError(_complaint(runs[index], why, fix))

    for_each_file([run.path for run in runs], check)
    return runs


def _complaint(run: Run, why: str, fix: str) -> str:
    """The complaint about another first sample than the initial state."""
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
