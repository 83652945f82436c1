"""The grade book: a row for each submission."""

from __future__ import annotations

import dataclasses
from collections import defaultdict
from collections.abc import Sequence
from typing import ClassVar

from ropeode.classroom.outcome import Outcome
from ropeode.classroom.rubric import Item
from ropeode.classroom.submissions import Submission, printable
from ropeode.json_form import json_shows
from ropeode.render import TEXT_WIDTH, Paragraph, columns, plain
from ropeode.render import rows as rows_of
from ropeode.validation import counted

HEADERS = ("submission", "status", "verdict", "order", "points", "message", "marks")
# Those with words of others.
_OF_OTHERS = {"submission", "message", "marks"}
_EXIT = {"right": 0, "wrong": 1}
_LONGEST_NAME = 24
# Of those that behave alike.
_MOST_NAMES = 5


@json_shows(
    *("submission=outcome.name", "status=outcome.status", "verdict", "order=outcome.order"),
    *("points", "earned=shares", "message", "marks"),
)
@dataclasses.dataclass(frozen=True)
class Row:
    """One submission in the grade book.

    Arguments:
        outcome: what became of it.
        earned: the points for each item of the rubric.
        marks: what a reader should know, such as that another one behaves alike.
    """

    outcome: Outcome
    earned: tuple[float, ...]
    marks: tuple[str, ...]

    @property
    def points(self) -> float:
        """In all."""
        return round(sum(self.earned), 2)

    @property
    def shares(self) -> tuple[float, ...]:
        """The points for each item, as they are shown."""
        return tuple(round(each, 2) for each in self.earned)

    @property
    def verdict(self) -> str | None:
        """Of the outcome; None where there is none."""
        return self.outcome.verdict or None

    @property
    def message(self) -> str:
        """What is wrong, in one line that can be printed."""
        return printable(self.outcome.message)

    @property
    def cells(self) -> tuple[str, ...]:
        """As text, in the order of `HEADERS`."""
        outcome = self.outcome
        order = "" if outcome.order is None else f"{outcome.order:.2f}"
        points, marks = f"{self.points:g}", "; ".join(self.marks)
        verdict = outcome.verdict
        return (outcome.name, outcome.status, verdict, order, points, self.message, marks)


@json_shows("items", "submissions=rows")
@dataclasses.dataclass(frozen=True)
class GradeBook:
    """The grade book of a class; JSON has the points for each item of the rubric, too.

    Arguments:
        rows: in the order of the submissions.
        rubric: by which points were given.
    """

    SCHEMA: ClassVar[str] = "ropeode.gradebook/1"

    rows: tuple[Row, ...]
    rubric: tuple[Item, ...]

    @property
    def items(self) -> list[dict[str, str | float]]:
        """The lines of the rubric."""
        return [{"name": item.name, "points": item.points} for item in self.rubric]

    @property
    def exit_code(self) -> int:
        """0 if all are right, 1 if some are wrong, 2 if some have no verdict."""
        return max(_EXIT.get(row.outcome.verdict, 2) for row in self.rows)

    @property
    def total(self) -> float:
        """The points that the rubric gives."""
        return sum(item.points for item in self.rubric)

    @property
    def summary(self) -> str:
        """How many of them are what, in one line."""
        verdicts = [row.outcome.verdict for row in self.rows]
        parts = [
            f"{verdicts.count(verdict)} {verdict or 'without a verdict'}"
            for verdict in ("right", "wrong", "undetermined", "")
            if verdict in verdicts
        ]
        submissions = counted(len(self.rows), "submission")
        return f"{submissions}: {', '.join(parts)}. Points are out of {self.total:g}."


def grade_book(
    submissions: Sequence[Submission], outcomes: Sequence[Outcome], rubric: Sequence[Item]
) -> GradeBook:
    """The grade book, in the order of the submissions.

    What was not checked to the end has no points.
    """
    alike: dict[str, list[str]] = defaultdict(list)
    for outcome in outcomes:
        if outcome.behaviour:
            alike[outcome.behaviour].append(outcome.name)
    rows = []
    for submission, outcome in zip(submissions, outcomes, strict=True):
        whole = outcome.status == "checked"
        earned = tuple(item.earned(outcome.findings) if whole else 0.0 for item in rubric)
        others = [each for each in alike[outcome.behaviour] if each != outcome.name]
        same = (f"same as {_named(others)}",) if outcome.behaviour and others else ()
        rows.append(Row(outcome, earned, (*same, *submission.marks)))
    return GradeBook(tuple(rows), tuple(rubric))


def _named(names: Sequence[str]) -> str:
    shown = ", ".join(names[:_MOST_NAMES])
    return f"{shown} and {more} more" if (more := len(names) - _MOST_NAMES) > 0 else shown


@rows_of.register
def _(book: GradeBook) -> list[dict[str, str]]:
    """As text, for a spreadsheet."""
    return [
        {
            head: _no_formula(cell) if head in _OF_OTHERS else cell
            for head, cell in zip(HEADERS, row.cells, strict=True)
        }
        for row in book.rows
    ]


def _no_formula(cell: str) -> str:
    """Text of others, which a spreadsheet must not take for a formula."""
    return f"'{cell}" if cell.startswith(("=", "+", "-", "@", "\t", "\r")) else cell


def as_text(book: GradeBook) -> str:
    """The grade book for a terminal of 80 columns; messages end where the line does."""
    heads = [*HEADERS[:5], "message"]
    cells = [[_cut(row.cells[0], _LONGEST_NAME), *row.cells[1:5], ""] for row in book.rows]
    lines = columns([heads, *cells], left={0, 1, 2, 5})
    start = lines[0].rindex("message")
    whole = [lines[0]]
    for line, row in zip(lines[1:], book.rows, strict=True):
        words = "; ".join(filter(None, (*row.marks, row.message)))
        whole.append(f"{line:{start}}{_cut(words, TEXT_WIDTH - start)}".rstrip())
    return "\n".join([*whole, "", plain([Paragraph(book.summary)])])


def _cut(text: str, longest: int) -> str:
    return text if len(text) <= longest else text[: longest - 3] + "..."
