"""Files of one program, read, with the likely mistake if they do not begin or sample right."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ropeode.checking.trajectories.explanations import (
    explain,
    explain_start,
    explain_times,
    times_complaint,
)
from ropeode.checking.trajectories.initial_states import (
    begins_in_single_precision,
    check_initial_states,
    misplaced_nodes,
)
from ropeode.checking.trajectories.run_files import FEWEST, Files, Run, finite, read_runs
from ropeode.checking.trajectories.time_errors import late_samples
from ropeode.errors import InputError, ReferenceRefused
from ropeode.problems import Problem
from ropeode.progress import Progress
from ropeode.references import Reference
from ropeode.validation import not_traced


def checked_runs(
    files: Sequence[str | Path],
    problem: Problem,
    dts: Any,
    certified: Callable[[], Reference],
    progress: Progress,
    fewest: int = FEWEST,
) -> tuple[tuple[Run, ...], float]:
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
        The runs, and the largest error of any number in a first sample.

    Raises:
        InputError: they cannot be used; with the mistake that explains it, if there is one.
    """
    not_traced("dts", dts)
    asked = Files(files, problem, dts, fewest)
    try:
        runs = read_runs(files, problem, dts, progress, fewest=fewest)
    except InputError:
        try:
            explanation = explain_times(certified, asked)
        except ReferenceRefused:
            explanation = None
        if explanation is None:
            raise
        raise InputError(times_complaint(explanation, asked)) from None
    try:
        return runs, check_initial_states(runs)
    except InputError:
        if why := _why(finite(runs) or runs, asked, certified):
            check_initial_states(runs, *why)
        raise


def _why(
    runs: Sequence[Run], files: Files, certified: Callable[[], Reference]
) -> tuple[str, str] | None:
    """What explains a wrong initial state, and how to mend it."""
    if all(np.all(run.values == run.values[0]) for run in runs):
        fix = "write a copy of the state, not the array that the next step overwrites"
        return "all rows of a file are the same", fix
    if begins_in_single_precision(runs):
        return "it is right in single precision", "compute it in double precision"
    if (placed := misplaced_nodes(runs)) is not None:
        return placed
    try:
        reference = certified()
    except ReferenceRefused:
        return explain_start(runs)
    explanation = explain(reference, runs, files)
    if explanation is not None:
        return explanation.line, explanation.fix
    late = late_samples(reference, runs)
    return explain_start(runs) if late is None else (late.line, late.remedy)
