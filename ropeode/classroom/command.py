"""`ropeode check FOLDER` and `ropeode grade FOLDER`: a class, and its grade book."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import click

from ropeode.checking import (
    Claims,
    chosen_checks,
    convergence_problems,
    reference_of,
)
from ropeode.classroom.gradebook import as_text, grade_book
from ropeode.classroom.pages import write_pages
from ropeode.classroom.rubric import OF_FILES, OF_STEPPERS, Item, read_rubric
from ropeode.classroom.running import Class
from ropeode.classroom.steppers import Steppers
from ropeode.classroom.submissions import stepper_submissions, trajectory_submissions
from ropeode.classroom.trajectories import Trajectories
from ropeode.files import refuse_code
from ropeode.progress import Progress
from ropeode.references import TIME_LIMIT, ReferenceOptions, reference_for
from ropeode.render import formatted
from ropeode.steppers import as_stepper
from ropeode.study import TableJob
from ropeode.terminal import NOTHING, end_on_ctrl_c, not_interrupted, put_out, with_progress
from ropeode.validation import bad_value

_KEPT = "finished submissions are kept; run the same command to resume"
_FORMS = ("text", "csv", "json")


def check_class(
    folder: Path,
    arguments: Mapping[str, Any],
    memory_mib: float,
    name: str | None,
    rubric: Path | None,
    form: str,
    out: Path | None,
) -> int:
    """Check the steppers of a folder, and print or write the grade book.

    Arguments:
        folder: of the submissions.
        arguments: of `check_stepper`, for each of them.
        memory_mib: memory that each may hold, in MiB.
        name: of the function, and the file in subfolders; see `stepper_submissions`.
        rubric: a file; None for the default one.
        form: `text`, `csv` or `json`, of what is printed.
        out: folder for the grade book and the feedback, which keeps what is done; None to print
            the grade book.

    Returns:
        the exit code.

    Raises:
        InputError: an argument cannot be used.
    """
    _check_output(folder, form, out)
    items = read_rubric(rubric, OF_STEPPERS)
    refuse_code("step", folder)
    chosen_checks(arguments["only"], arguments["skip"], arguments["quick"])
    submissions = stepper_submissions(folder, name, without=out)

    def compute(progress: Progress) -> None:
        # Before the time of any submission; each finds them in the cache folder.
        for rope in convergence_problems().values():
            progress("references", None)
            reference_of(rope)

    with_progress(compute)
    asked = Steppers(memory_mib, arguments)
    return _put_book(Class(folder, submissions, asked, _results(out)), items, form, out)


def grade_class(
    folder: Path,
    values: Mapping[str, Any],
    spec_folder: Path | None,
    dts: Sequence[str] | None,
    claims: Claims,
    memory_mib: float,
    rubric: Path | None,
    form: str,
    out: Path | None,
) -> int:
    """Grade the trajectories of a folder, and print or write the grade book.

    Arguments:
        folder: of the submissions.
        values: of the spec of the problem, as `TableJob` takes them.
        spec_folder: likewise.
        dts: step sizes of the files of each submission, in the order of their names; None where
            the files contain them.
        claims: of each.
        memory_mib: as for `check_class`, like what follows.
        rubric: likewise.
        form: likewise.
        out: likewise.

    Returns:
        the exit code.

    Raises:
        InputError: an argument cannot be used.
        ReferenceRefused: no reference of the problem can be certified.
    """
    _check_output(folder, form, out)
    items = read_rubric(rubric, OF_FILES)
    submissions = trajectory_submissions(folder, without=out)
    job = TableJob(values, spec_folder)
    if claims.method is not None:
        as_stepper(claims.method).require(job.problem)
    options = ReferenceOptions(**job.spec.asked)
    truth = with_progress(lambda progress: reference_for(job.given, options, progress))
    asked = Trajectories(
        memory_mib,
        values=values,
        folder=str((spec_folder or Path()).resolve()),
        arguments={
            "dts": dts,
            "expected_order": claims.order,
            "method": claims.method,
            "damped_order": claims.damped_order,
        },
        truth=hashlib.sha256(truth.states.tobytes()).hexdigest(),
        time_limit=job.spec.time_limit or TIME_LIMIT,
    )
    # A reference from a file is there for all already.
    shared = None if "reference" in values else truth
    own = Class(folder, submissions, asked, _results(out), shared)
    return _put_book(own, items, form, out)


def _check_output(folder: Path, form: str, out: Path | None) -> None:
    if form not in _FORMS:
        allowed = f"{', '.join(_FORMS)}, of a FOLDER"
        raise bad_value("format", form, allowed, "use -o DIR for pages")
    if out is not None and out.resolve() == folder.resolve():
        raise bad_value("out", str(out), "another folder than that of the submissions", "-o graded")


def _results(out: Path | None) -> Path | None:
    return None if out is None else out / "results"


def _put_book(own: Class, items: Sequence[Item], form: str, out: Path | None) -> int:
    """Examine what is left, and print or write the grade book."""
    end_on_ctrl_c(NOTHING if out is None else _KEPT, before=own.end)
    outcomes = with_progress(own.outcomes, time_left=True)
    book = grade_book(own.submissions, outcomes, items)
    if out is None:
        put_out(as_text(book) if form == "text" else formatted(book, form), None)
    else:
        with not_interrupted():
            write_pages(book, out)
        click.echo(f"{book.summary} See {out / 'gradebook.html'}.", err=True)
    return book.exit_code
