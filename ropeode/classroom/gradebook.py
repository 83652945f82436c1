"""The grade book: a row for each submission."""

from __future__ import annotations

import csv
import io
import json
from collections import defaultdict
from collections.abc import Sequence
from typing import NamedTuple

from ropeode.classroom.outcome import Outcome
from ropeode.classroom.rubric import Item
from ropeode.classroom.submissions import Submission, printable
from ropeode.render import TEXT_WIDTH, columns
from ropeode.validation import counted

HEADERS = ("submission", "status", "verdict", "order", "points", "message", "marks")
SCHEMA = "ropeode.gradebook/1"
_EXIT = {"right": 0, "wrong": 1}
_LONGEST_NAME = 24
# Of those that behave alike.
_MOST_NAMES = 5


class Row(NamedTuple):
    """One submission in the grade book.

    Fields:
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
    def cells(self) -> tuple[str, ...]:
        """As text, in the order of `HEADERS`."""
        outcome = self.outcome
        order = "" if outcome.order is None else f"{outcome.order:.2f}"
        return (
            outcome.name,
            outcome.status,
            outcome.verdict,
            order,
            f"{self.points:g}",
            printable(outcome.message),
            "; ".join(self.marks),
        )


def grade_book(
    submissions: Sequence[Submission], outcomes: Sequence[Outcome], rubric: Sequence[Item]
) -> list[Row]:
    """The rows, in the order of the submissions.

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
    return rows


def _named(names: Sequence[str]) -> str:
    shown = ", ".join(names[:_MOST_NAMES])
    return f"{shown} and {more} more" if (more := len(names) - _MOST_NAMES) > 0 else shown


def exit_code(rows: Sequence[Row]) -> int:
    """0 if all are right, 1 if some are wrong, 2 if some have no verdict."""
    return max(_EXIT.get(row.outcome.verdict, 2) for row in rows)


def as_csv(rows: Sequence[Row]) -> str:
    """The grade book for a spreadsheet."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(HEADERS)
    for row in rows:
        name, status, verdict, order, points, *texts = row.cells
        numbers = (status, verdict, order, points)
        writer.writerow([_no_formula(name), *numbers, *map(_no_formula, texts)])
    return text.getvalue()


def as_json(rows: Sequence[Row], rubric: Sequence[Item]) -> str:
    """The grade book for programs, with the points for each item of the rubric."""
    book = {
        "schema": SCHEMA,
        "items": [{"name": item.name, "points": item.points} for item in rubric],
        "submissions": [
            {
                "submission": row.outcome.name,
                "status": row.outcome.status,
                "verdict": row.outcome.verdict or None,
                "order": row.outcome.order,
                "points": row.points,
                "earned": [round(each, 2) for each in row.earned],
                "message": printable(row.outcome.message),
                "marks": list(row.marks),
            }
            for row in rows
        ],
    }
    return json.dumps(book, indent=2, ensure_ascii=False) + "\n"


def _no_formula(cell: str) -> str:
    """Text of others, which a spreadsheet must not take for a formula."""
    return f"'{cell}" if cell.startswith(("=", "+", "-", "@", "\t", "\r")) else cell


def as_text(rows: Sequence[Row], rubric: Sequence[Item]) -> str:
    """The grade book for a terminal of 80 columns; messages end where the line does."""
    heads = [*HEADERS[:5], "message"]
    cells = [[_cut(row.cells[0], _LONGEST_NAME), *row.cells[1:5], ""] for row in rows]
    lines = columns([heads, *cells], left={0, 1, 2, 5})
    start = lines[0].rindex("message")
    whole = [lines[0]]
    for line, row in zip(lines[1:], rows, strict=True):
        words = "; ".join(filter(None, (*row.marks, row.cells[5])))
        whole.append(f"{line:{start}}{_cut(words, TEXT_WIDTH - start)}".rstrip())
    return "\n".join([*whole, "", summary(rows, rubric), ""])


def summary(rows: Sequence[Row], rubric: Sequence[Item]) -> str:
    """How many of them are what, in one line."""
    verdicts = [row.outcome.verdict for row in rows]
    parts = [
        f"{verdicts.count(verdict)} {words}"
        for verdict, words in (
            ("right", "right"),
            ("wrong", "wrong"),
            ("undetermined", "undetermined"),
            ("", "without a verdict"),
        )
        if verdict in verdicts
    ]
    total = sum(item.points for item in rubric)
    return f"{counted(len(rows), 'submission')}: {', '.join(parts)}. Points are out of {total:g}."


def _cut(text: str, longest: int) -> str:
    return text if len(text) <= longest else text[: longest - 3] + "..."
