"""The report of a check or a grade, line by line, in the words of the command line."""

from __future__ import annotations

from collections.abc import Iterator

from ropeode.checking import CheckReport
from ropeode.laboratory.messages import Line
from ropeode.render import check_summary, check_title, diagnosis_lines


def lines_of(report: CheckReport, judged: bool = True) -> tuple[Line, ...]:
    """What was checked, the verdict, what explains failures, each finding, and notes.

    Arguments:
        report: of a check or a grade.
        judged: whether all checks are made; there is no verdict before the last.
    """
    return tuple(_lines(report, judged))


def _lines(report: CheckReport, judged: bool) -> Iterator[Line]:
    yield Line(status="title", text=check_title(report))
    if judged:
        yield Line(status=report.verdict, text=check_summary(report))
    for text in diagnosis_lines(report):
        yield Line(status="diagnosis", text=text)
    for finding in report.findings:
        yield Line(status=finding.status, text=f"{finding.check}: {finding.line}")
    for note in report.notes:
        yield Line(status="note", text=f"Note: {note}")
