"""The verdicts of `ropeode check` and `ropeode grade`, line by line, and the runs of files."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from ropeode.analysis import RESOLUTION_FACTOR, error_series
from ropeode.checking import CHECKS, FEWEST, CheckReport, Files, check_stepper
from ropeode.checking import Run as FileRun
from ropeode.checking.grade import grade as graded
from ropeode.checking.trajectories.checked_runs import checked_runs
from ropeode.errors import InputError
from ropeode.laboratory.answers import Answer
from ropeode.laboratory.certified_motion import CertifiedMotion
from ropeode.laboratory.messages import (
    AskCheck,
    AskGrade,
    Checked,
    GivenFile,
    Graded,
    Line,
    Run,
)
from ropeode.laboratory.setup import Laboratory
from ropeode.progress import Progress, part_of
from ropeode.render import check_summary, check_title, diagnosis_lines
from ropeode.validation import bad_value

# Of processor time that the step may take in each check: somebody looks on.
_SECONDS = 10.0


def check(ask: AskCheck, laboratory: Laboratory, progress: Progress) -> Answer:
    """See `ropeode.laboratory.answers.answer_to`."""
    stepper = laboratory.stepper(ask.stepper, ask.version)
    report = check_stepper(stepper, quick=ask.quick, time_limit=_SECONDS, progress=progress)
    made, checks = len(report.findings), len(CHECKS)
    lines = tuple(_lines(report, judged=made == checks))
    return Checked(stepper=stepper.label, made=made, checks=checks, lines=lines), {}


def _lines(report: CheckReport, judged: bool = True) -> Iterator[Line]:
    """What was checked, the verdict, what explains failures, each finding, and notes.

    Arguments:
        report: of a check or a grade.
        judged: whether all checks are made; there is no verdict before the last.
    """
    yield Line(status="title", text=check_title(report))
    if judged:
        yield Line(status=report.verdict, text=check_summary(report))
    for text in diagnosis_lines(report):
        yield Line(status="diagnosis", text=text)
    for finding in report.findings:
        yield Line(status=finding.status, text=f"{finding.check}: {finding.line}")
    for note in report.notes:
        yield Line(status="note", text=f"Note: {note}")


def grade(ask: AskGrade, laboratory: Laboratory, progress: Progress) -> Answer:
    """See `ropeode.laboratory.answers.answer_to`."""
    motion = laboratory.motion(ask.problem, part_of(progress, 0.0, 0.5))
    reference, later = motion.reference, part_of(progress, 0.5, 1.0)
    with tempfile.TemporaryDirectory(prefix="ropeode-") as folder:
        try:
            paths = _written(ask.files, Path(folder))
            found = checked_runs(Files(paths, motion.problem, None, 1), lambda: reference, later)
            report = None
            if len(paths) >= FEWEST:
                report = graded(paths, reference, progress=later)
        except InputError as error:
            # The page knows its files by their names.
            raise InputError([line.replace(f"{folder}/", "") for line in error.problems]) from None
    words = f"Fewer than {FEWEST} files show no order; they are drawn, and not graded."
    lines = _lines(report) if report else [Line(status="note", text=words)]
    each_run = [_run(motion, run) for run in found]
    arrays = {
        f"{index}.{name}": values
        for index, (_, own) in enumerate(each_run)
        for name, values in own.items()
    }
    return Graded(lines=tuple(lines), runs=tuple(run for run, _ in each_run)), arrays


def _written(files: Sequence[GivenFile], folder: Path) -> list[Path]:
    """The files in a folder, under their own names."""
    names = [Path(each.name.replace("\\", "/")).name for each in files]
    if len(set(names)) < len(names):
        raise bad_value("files", names, "files of different names", "rename one")
    paths = [folder / name for name in names]
    for path, each in zip(paths, files, strict=True):
        if path.suffix.lower() != ".csv":
            allowed = "a file whose name ends in .csv"
            raise bad_value("file", path.name, allowed, "`ropeode grade` takes NPZ and NetCDF too")
        path.write_text(each.text, "utf-8")
    return paths


def _run(motion: CertifiedMotion, run: FileRun) -> tuple[Run, dict[str, np.ndarray]]:
    errors = error_series(run.states, motion.reference, motion.norm.name)
    message = Run(
        stepper=run.path.name,
        dt=run.dt,
        every=motion.samples_per_frame,
        status="ok",
        error_max=errors.max,
        resolution=float(RESOLUTION_FACTOR * motion.reference.bound(motion.norm)[-1]),
    )
    arrays = motion.differences(run.states, motion.samples_per_frame)
    if run.quantities != motion.problem.quantities:
        # Without velocities there is no energy.
        arrays.pop("energy_differences", None)
    return message, arrays
