"""Grades trajectories from any program: does it solve the problem, and with which order?"""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ropeode.checking.claims import checked_claims
from ropeode.checking.report import CheckReport, Claims, Diagnosis, Finding, exactly
from ropeode.checking.trajectories.conservation import energy_finding, pins_finding
from ropeode.checking.trajectories.convergence import order_finding
from ropeode.checking.trajectories.initial_states import check_initial_states
from ropeode.checking.trajectories.run_files import Run, names_of, read_runs
from ropeode.checking.trajectories.time_errors import timing_diagnosis
from ropeode.problems.problem import Problem
from ropeode.progress import Progress, silent
from ropeode.references.compute import reference_for
from ropeode.references.options import ReferenceOptions
from ropeode.references.reference import Reference, problem_of
from ropeode.steppers import as_stepper
from ropeode.study.accuracy_table import problem_class


def grade(
    files: Sequence[str | Path],
    problem: Problem | Reference,
    dts: Sequence[Any] | None = None,
    expected_order: int | None = None,
    *,
    method: str | None = None,
    accuracy: float | None = None,
    rtol: float | None = None,
    diagnose: bool = True,
    progress: Progress = silent,
    **asked: Any,
) -> CheckReport:
    """Compare trajectories of one program, with several step sizes, with a certified reference.

    Files are read in blocks, and only the samples at the problem's sample times are kept, so
    files may be larger than memory. docs/grade.md describes their format.

    Arguments:
        files: CSV, NPZ or NetCDF, at least three, one for each step size.
        problem: the problem that the program should solve, or a reference of it.
        dts: step size of each file; None if the files contain it.
        expected_order: the order that the program should have; None to measure it.
        method: the stepper of ropeode that the program is meant to be, in place of an order.
        accuracy: as for `ropeode.reference`.
        rtol: as for `ropeode.reference`.
        diagnose: look for the cause if the order is wrong or not claimed.
        progress: called with the current task and the fraction that is done.
        asked: `level`, `digits` and `time_limit` of `ropeode.reference`.

    Returns:
        The report; ``report.passed`` is the verdict.

    Raises:
        InputError: an argument or a file cannot be used; one line for each, with the place.
        ReferenceRefused: no reference of the problem can be certified.
    """
    started = time.perf_counter()
    claims = checked_claims(Claims(expected_order, method))
    own = problem_of(problem)
    expected = claims.order
    if claims.method is not None:
        stepper = as_stepper(claims.method)
        stepper.require(own)
        expected = stepper.order(problem_class(own))
    runs = read_runs(files, own, dts, lambda text, share: progress(text, 0.9 * (share or 0.0)))
    off = check_initial_states(runs)
    options = ReferenceOptions(accuracy=accuracy, rtol=rtol, **asked)
    reference = reference_for(problem, options, lambda text, _: progress(text, 0.9))
    order, notes = _order(reference, runs, claims, expected)
    findings = (
        Finding("initial-state", "pass", f"the first sample is the initial state {exactly(off)}"),
        order,
        pins_finding(reference, runs),
        energy_finding(reference, runs),
    )
    diagnosis: tuple[Diagnosis, ...] = ()
    wrong = order.status == "fail"
    if diagnose and (wrong or expected is None):
        progress("diagnosis", 0.95)
        timing = timing_diagnosis(reference, runs)
        if wrong:
            diagnosis = _diagnosed(reference, runs) if timing is None else (timing,)
        elif timing is not None:
            # No claim is refuted, but such a program is hardly intended.
            notes = (*notes, timing.line)
    progress("done", 1.0)
    return CheckReport(
        label=names_of(runs),
        claims=claims,
        findings=findings,
        diagnosis=diagnosis,
        notes=(*notes, *_notes(runs, reference)),
        seconds=time.perf_counter() - started,
    )


def _order(
    reference: Reference, runs: Sequence[Run], claims: Claims, expected: int | None
) -> tuple[Finding, tuple[str, ...]]:
    """The verdict on convergence; no order is needed if a wrong number of steps explains all."""
    finding, notes = order_finding(reference, runs, claims, expected)
    if finding.status == "undetermined":
        timing = timing_diagnosis(reference, runs)
        if timing is not None:
            return Finding("order", "fail", f"no order; {timing.line}", timing.evidence), ()
    return finding, notes


def _diagnosed(reference: Reference, runs: Sequence[Run]) -> tuple[Diagnosis, ...]:
    """What the runs solve instead of the problem."""
    # Not above: it imports diffrax, which right programs do not need.
    from ropeode.checking.diagnosis.trajectories import diagnose_trajectories

    problem, quantities = reference.problem, runs[0].quantities
    states = [(run.dt, run.states.copy()) for run in runs]
    if len(quantities) < len(problem.quantities):
        for _, each in states:
            each[:, 1] = np.nan
    with np.errstate(all="ignore"):  # Runs that blew up have huge numbers.
        return diagnose_trajectories(problem, reference, states, quantities)


def _notes(runs: Sequence[Run], reference: Reference) -> list[str]:
    notes = [
        f"{run.path.name}: dt = {run.dt:g} does not divide the {run.interval:g} between samples; "
        "the last step before each sample must be shorter"
        for run in runs
        if run.uneven
    ]
    if reference.horizon is not None:
        notes.append(
            f"only samples before t = {reference.horizon:g} count, where the reference is trusted"
        )
    if runs[0].quantities != reference.problem.quantities:
        notes.append("the files have no velocities: only positions are graded")
    return notes
