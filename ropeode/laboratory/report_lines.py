"""The report of a check or a grade, line by line, in the words of the command line."""

from __future__ import annotations

from collections.abc import Iterator

from ropeode.checking.report import CheckReport
from ropeode.laboratory.messages import Line
from ropeode.render.check import title, verdict


def lines_of(report: CheckReport) -> tuple[Line, ...]:
    """What was checked, each finding, what explains failures, notes, and the verdict."""
    return tuple(_lines(report))


def _lines(report: CheckReport) -> Iterator[Line]:
    yield Line(status="title", text=title(report))
    for finding in report.findings:
        yield Line(status=finding.status, text=f"{finding.check}: {finding.line}")
    for each in report.diagnosis:
        yield Line(status="diagnosis", text=f"Diagnosis ({each.cause}): {each.line}")
        if each.remedy:
            yield Line(status="diagnosis", text=f"To mend it: {each.remedy}")
    for note in report.notes:
        yield Line(status="note", text=f"Note: {note}")
    yield Line(status=report.verdict, text=verdict(report))
