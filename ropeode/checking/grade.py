"""Grading trajectories that any program wrote: does it solve the problem, and how well?"""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ropeode.checking.report import CheckReport, Claims, Diagnosis, Finding
from ropeode.checking.trajectories.conservation import energy_finding, pins_finding
from ropeode.checking.trajectories.convergence import order_finding
from ropeode.checking.trajectories.initial_states import check_initial_states
from ropeode.checking.trajectories.layout import Layout, states_of
from ropeode.checking.trajectories.run_files import (
    Progress,
    Run,
    names_of,
    quantities_of,
    read_runs,
)
from ropeode.checking.trajectories.time_errors import clock_diagnosis
from ropeode.errors import InputError
from ropeode.problems.problem import Problem
from ropeode.references.compute import reference_for
from ropeode.references.options import ReferenceOptions
from ropeode.references.reference import Reference, problem_of
from ropeode.validation import check_whole, complaint


def grade(
    files: Sequence[str | Path],
    problem: Problem | Reference,
    dts: Sequence[Any] | None = None,
    expected_order: int | None = None,
    *,
    accuracy: float | None = None,
    rtol: float | None = None,
    diagnose: bool = True,
    progress: Progress = lambda text, fraction: None,
    **asked: Any,
) -> CheckReport:
    """Hold trajectories of one program, with several step sizes, against a certified reference.

    Files are read in blocks, and only samples at the problem's sample times are kept, so that
    they may be larger than memory. docs/grade.md says what they have to hold.

    Arguments:
        files: CSV, NPZ or NetCDF, at least three, one for each step size.
        problem: that the program is to solve, or a reference of it that exists already.
        dts: step size of each file; None where the files say it.
        expected_order: that the program is to have; None if it is not known.
        accuracy: as for `ropeode.reference`.
        rtol: as for `ropeode.reference`.
        diagnose: look for the cause of errors that are wrong, or of which nothing is claimed.
        progress: called with what is being done and the fraction that is done.
        asked: `level`, `digits` and `time_limit` of `ropeode.reference`.

    Returns:
        The report; ``report.passed`` is the verdict.

    Raises:
        InputError: an argument or a file cannot be used; one line for each, with the place.
        ReferenceRefused: no reference can be had for the problem.
    """
    started = time.perf_counter()
    if expected_order is not None:
        expected_order = check_whole("expected_order", expected_order, at_least=1, example="2")
    if isinstance(files, (str, Path)):
        raise InputError(complaint("files", str(files), "a list of files", "put it into a list"))
    own = problem_of(problem)
    runs = read_runs(files, own, dts, lambda text, share: progress(text, 0.9 * share))
    off = check_initial_states(runs, own)
    options = ReferenceOptions(accuracy, rtol, **asked)
    known = reference_for(problem, options, lambda text, _: progress(text, 0.9))
    order, notes = _order(known, runs, expected_order)
    exact = "to the last digit" if off == 0.0 else f"to rounding ({off:.1e})"
    findings = (
        Finding("initial-state", "pass", f"the first sample is the initial state, {exact}"),
        order,
        pins_finding(known, runs),
        energy_finding(known, runs),
    )
    diagnosis: tuple[Diagnosis, ...] = ()
    wrong = order.status == "fail"
    if diagnose and (wrong or expected_order is None):
        progress("diagnosis", 0.95)
        clock = clock_diagnosis(known, runs)
        if wrong:
            diagnosis = _solved_instead(known, runs) if clock is None else (clock,)
        elif clock is not None:
            # Nothing that was claimed is refuted, and yet it is hardly meant.
            notes = (*notes, clock.line)
    progress("done", 1.0)
    return CheckReport(
        label=names_of(runs),
        claims=Claims(order=expected_order),
        findings=findings,
        diagnosis=diagnosis,
        notes=(*notes, *_notes(runs, known)),
        seconds=time.perf_counter() - started,
    )


def _order(
    reference: Reference, runs: Sequence[Run], expected: int | None
) -> tuple[Finding, tuple[str, ...]]:
    """The verdict on convergence; errors that a wrong count of steps explains need no order."""
    try:
        return order_finding(reference, runs, expected)
    except InputError:
        clock = clock_diagnosis(reference, runs)
        if clock is None:
            raise
        return Finding("order", "fail", f"no order; {clock.line}", clock.evidence), ()


def _solved_instead(reference: Reference, runs: Sequence[Run]) -> tuple[Diagnosis, ...]:
    """What the runs solve in place of the problem, as far as they tell."""
    # Not above: it imports diffrax and optimistix, and right programs need none of it.
    from ropeode.checking.diagnosis.trajectories import diagnose_trajectories

    problem = reference.problem
    states = [(run.dt, states_of(problem, run.values)) for run in runs]
    quantities = quantities_of(problem, runs)
    if len(quantities) < len(problem.quantities):
        for _, each in states:
            each[:, 1] = np.nan
    with np.errstate(all="ignore"):  # Runs that blew up have huge numbers.
        return diagnose_trajectories(problem, reference, states, quantities)


def _notes(runs: Sequence[Run], reference: Reference) -> list[str]:
    notes = [
        f"{run.path.name}: dt = {run.dt:g} does not divide the {run.interval:g} between samples; "
        "the last step before each has to be a shorter one"
        for run in runs
        if run.uneven
    ]
    if reference.horizon is not None:
        notes.append(
            f"judged before t = {reference.horizon:g} only, where the reference is trusted"
        )
    layout = Layout.of(reference.problem)
    if layout.mechanical and runs[0].values.shape[2] == layout.dim:
        notes.append("the files have no velocities: positions alone are judged")
    return notes
