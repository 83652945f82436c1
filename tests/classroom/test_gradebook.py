"""The rows of a grade book, its formats, and what is kept of it."""

from __future__ import annotations

import csv
import dataclasses
import io

import pytest

from ropeode.classroom.gradebook import as_csv, as_text, exit_code, grade_book
from ropeode.classroom.order_plot import order_plot
from ropeode.classroom.outcome import Outcome, keep, kept
from ropeode.classroom.pages import write_pages
from ropeode.classroom.rubric import Item
from ropeode.classroom.submissions import Submission

RUBRIC = (Item("runs", 2.0), Item("pins", 3.0, ("pins",)))
RIGHT = Outcome("anna", "checked", "right", 1.98, findings={"pins": "pass"}, behaviour="one")


def rows_of(*outcomes):
    submissions = [Submission(each.name, (f"{each.name}.py",), "", "") for each in outcomes]
    return grade_book(submissions, outcomes, RUBRIC)


def other(name, **changes):
    return dataclasses.replace(RIGHT, name=name, **changes)


def test_points_and_marks():
    wrong = other("bert", verdict="wrong", findings={"pins": "fail"}, behaviour="two")
    crashed = other("dora", status="crashed", verdict="wrong", behaviour="")
    rows = rows_of(RIGHT, wrong, other("carla"), crashed, other("emil", behaviour=""))
    assert [row.points for row in rows] == [5.0, 2.0, 5.0, 0.0, 5.0]
    # Of two whose behaviour is not known, nobody can say that they behave alike.
    assert [row.marks for row in rows] == [("same as carla",), (), ("same as anna",), (), ()]


@pytest.mark.parametrize(
    ("verdicts", "code"),
    [
        (["right", "right"], 0),
        (["right", "wrong"], 1),
        (["wrong", "undetermined"], 2),
        (["right", ""], 2),
    ],
)
def test_the_exit_code(verdicts, code):
    outcomes = [other(str(i), verdict=each) for i, each in enumerate(verdicts)]
    assert exit_code(rows_of(*outcomes)) == code


def test_the_csv_is_for_spreadsheets():
    text = as_csv(rows_of(RIGHT, other("=1+1", order=-0.25, message='a "b", c')))
    head, first, second = csv.reader(io.StringIO(text))
    assert head[:6] == ["submission", "status", "verdict", "order", "points", "message"]
    assert first[:5] == ["anna", "checked", "right", "1.98", "5"]
    assert second[0] == "'=1+1"
    assert second[3] == "-0.25"
    assert second[5] == 'a "b", c'


def test_the_text_fits_a_terminal():
    text = as_text(rows_of(other("a" * 60, message="b" * 200, status="out of memory")), RUBRIC)
    assert max(map(len, text.splitlines())) == 80
    assert "Points are out of 5." in text


def test_pages_show_what_others_wrote_as_text(tmp_path):
    name = "<b>&'anna'"
    rows = rows_of(other(name, message="<script>alert(1)</script>", page="<p>report</p>"))
    write_pages(rows, RUBRIC, tmp_path)
    book = (tmp_path / "gradebook.html").read_text()
    assert "<script>alert" not in book
    assert "<b>" not in book
    assert "&lt;script&gt;alert(1)" in book
    page = (tmp_path / f"feedback/{name}.html").read_text()
    assert "5 of 5 points" in page
    assert "<b>" not in page
    assert (tmp_path / f"feedback/{name}.md").read_text().startswith(f"# {name}\n")


def test_what_is_kept_is_for_the_same_key(tmp_path):
    keep(RIGHT, "key", tmp_path)
    assert kept("anna", "key", tmp_path) == RIGHT
    assert kept("anna", "other", tmp_path) is None
    assert kept("bert", "key", tmp_path) is None
    (tmp_path / "anna.json").write_text("{")
    assert kept("anna", "key", tmp_path) is None


def quantities(errors, observed):
    return {"position": {"errors": errors, "observed": observed}}


def test_the_order_plot_has_a_mark_for_each_error():
    convergence = {
        "dt": [0.1, 0.05, 0.025, 0.0125],
        "expected": 2,
        "quantities": quantities([None, 4e-2, 1e-2, 0.0], 2.0),
    }
    drawn = order_plot("order-free", convergence)
    # One more stands beside its name.
    assert drawn.count("<circle") == 2 + 1
    assert "dashed: order 2" in drawn
    assert "position: order 2.00" in drawn
    assert order_plot("x", {**convergence, "quantities": quantities([None] * 4, None)}) == ""
