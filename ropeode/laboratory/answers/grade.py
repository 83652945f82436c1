"""Files of any program against the truth: the verdict of `ropeode grade`, and their runs."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ropeode.analysis import RESOLUTION_FACTOR, error_series
from ropeode.checking import FEWEST
from ropeode.checking import Run as FileRun
from ropeode.checking.grade import grade
from ropeode.checking.trajectories.checked_runs import checked_runs
from ropeode.errors import InputError
from ropeode.laboratory.answers import Answer
from ropeode.laboratory.certified_motion import CertifiedMotion
from ropeode.laboratory.messages import AskGrade, GivenFile, Graded, Line, Run
from ropeode.laboratory.report_lines import lines_of
from ropeode.laboratory.runs_beside import differences_of
from ropeode.laboratory.setup import Laboratory
from ropeode.progress import Progress, part_of
from ropeode.validation import bad_value


def answer(ask: AskGrade, laboratory: Laboratory, progress: Progress) -> Answer:
    """See `ropeode.laboratory.answers.answer_to`."""
    motion = laboratory.motion(ask.problem, part_of(progress, 0.0, 0.5))
    reference, later = motion.reference, part_of(progress, 0.5, 1.0)
    with tempfile.TemporaryDirectory(prefix="ropeode-") as folder:
        try:
            paths = _written(ask.files, Path(folder))
            runs, _ = checked_runs(
                paths, motion.problem, ask.dts, lambda: reference, later, fewest=1
            )
            report = None
            if len(paths) >= FEWEST:
                report = grade(paths, reference, ask.dts, progress=later)
        except InputError as error:
            # The page knows its files by their names.
            raise InputError([line.replace(f"{folder}/", "") for line in error.problems]) from None
    if report is not None:
        lines = lines_of(report)
    else:
        words = f"Fewer than {FEWEST} files show no order; they are drawn, and not graded."
        lines = (Line(status="note", text=words),)
    each_run = [_run(motion, run) for run in runs]
    arrays = {
        f"{index}.{name}": values
        for index, (_, own) in enumerate(each_run)
        for name, values in own.items()
    }
    message = Graded(
        passed=report is not None and report.passed,
        lines=lines,
        runs=tuple(run for run, _ in each_run),
    )
    return message, arrays


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
        steps_per_frame=None,
        dt=run.dt,
        every=motion.samples_per_frame,
        status="ok",
        diverged_at=None,
        error_final=errors.final,
        error_max=errors.max,
        error_rms=errors.rms,
        resolution=float(RESOLUTION_FACTOR * motion.reference.bound(motion.norm)[-1]),
        round_off=None,
        rhs_evaluations=None,
        seconds=None,
    )
    arrays = differences_of(motion, run.states, motion.samples_per_frame)
    if run.quantities != motion.problem.quantities:
        # Without velocities there is no energy.
        arrays.pop("energy_differences", None)
    return message, arrays
