"""`ropeode check FOLDER`: checks the submissions of a folder and writes their grade book."""

from __future__ import annotations

from pathlib import Path

import click

from ropeode.classroom.gradebook import as_csv, as_text, exit_code, grade_book, summary
from ropeode.classroom.pages import write_pages
from ropeode.classroom.rubric import read_rubric
from ropeode.classroom.running import Asked as Asked
from ropeode.classroom.running import Class
from ropeode.classroom.submissions import submissions_in
from ropeode.terminal.output import put_out
from ropeode.terminal.running import NOTHING, end_on_ctrl_c, not_interrupted, with_progress
from ropeode.validation import bad_value

_KEPT = "finished submissions are kept; run the same command to resume"


def check_class(
    folder: Path,
    asked: Asked,
    name: str | None,
    rubric: Path | None,
    form: str,
    out: Path | None,
) -> int:
    """Check the submissions of a folder, and print or write the grade book.

    Arguments:
        folder: of the submissions.
        asked: of each of them.
        name: of the function, and the file in subfolders; see `submissions_in`.
        rubric: a file; None for the default one.
        form: `text` or `csv`, of what is printed.
        out: folder for the grade book and the feedback, which keeps what is done; None to print
            the grade book.

    Returns:
        the exit code.

    Raises:
        InputError: an argument cannot be used.
    """
    if form not in ("text", "csv"):
        raise bad_value("format", form, "text or csv, of a FOLDER", "use -o DIR for pages")
    items = read_rubric(rubric)
    if out is not None and out.resolve() == folder.resolve():
        raise bad_value("out", str(out), "another folder than that of the submissions", "-o graded")
    submissions = submissions_in(folder, name, without=out)
    results = None if out is None else out / "results"
    own = Class(folder, submissions, asked, results)
    end_on_ctrl_c(NOTHING if out is None else _KEPT, before=own.end)
    rows = grade_book(submissions, with_progress(own.outcomes, time_left=True), items)
    if out is None:
        put_out(as_csv(rows) if form == "csv" else as_text(rows, items), None)
    else:
        with not_interrupted():
            write_pages(rows, items, out)
        click.echo(f"{summary(rows, items)} See {out / 'gradebook.html'}.", err=True)
    return exit_code(rows)
