"""The rows of a grade book, and its formats."""

from __future__ import annotations

import base64
import csv
import dataclasses
import hashlib
import io
import json
import re
from pathlib import Path

import pytest

from ropeode.classroom import (
    Item,
    Outcome,
    Submission,
    as_csv,
    as_json,
    as_text,
    exit_code,
    grade_book,
    parts,
    write_pages,
)
from ropeode.render import Code, Grid, Heading, Paragraph

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
    # Of many, some are named.
    rows = rows_of(*(other(name) for name in "abcdefgh"))
    assert rows[0].marks == ("same as b, c, d, e, f and 2 more",)
    assert rows_of(*(other(name) for name in "abcdef"))[5].marks == ("same as a, b, c, d, e",)


@pytest.mark.parametrize(
    ("verdicts", "code"),
    [("right right", 0), ("right wrong", 1), ("wrong undetermined", 2), ("right ", 2)],
)
def test_the_exit_code(verdicts, code):
    outcomes = [other(str(i), verdict=each) for i, each in enumerate(verdicts.split(" "))]
    assert exit_code(rows_of(*outcomes)) == code


def test_the_csv_is_for_spreadsheets():
    text = as_csv(rows_of(RIGHT, other("=1+1", order=-0.25, message='a "b", c')))
    head, first, second = csv.reader(io.StringIO(text))
    assert head[:6] == ["submission", "status", "verdict", "order", "points", "message"]
    assert first[:5] == ["anna", "checked", "right", "1.98", "5"]
    assert (second[0], second[3], second[5]) == ("'=1+1", "-0.25", 'a "b", c')


def test_the_json_is_for_programs():
    wrong = other("bert", verdict="wrong", order=None, findings={"pins": "fail"}, message="ä")
    book = json.loads(as_json(rows_of(RIGHT, wrong, other("c", status="x", verdict="")), RUBRIC))
    assert book["items"] == [{"name": "runs", "points": 2.0}, {"name": "pins", "points": 3.0}]
    first, second, third = book["submissions"]
    assert (first["points"], first["earned"], first["order"]) == (5.0, [2.0, 3.0], 1.98)
    assert (second["earned"], second["order"], second["message"]) == ([2.0, 0.0], None, "ä")
    assert (third["verdict"], third["earned"], third["status"]) == (None, [0.0, 0.0], "x")
    # Every key is documented.
    page = (Path(__file__).parents[2] / "docs/howto/classroom.md").read_text()
    assert all(f"`{word}`" in page for word in (*book, *first, book["schema"]))


def test_the_text_fits_a_terminal():
    text = as_text(rows_of(other("a" * 60, message="b" * 200, status="out of memory")), RUBRIC)
    assert max(map(len, text.splitlines())) == 80
    assert "Points are out of 5." in text


def test_pages_show_what_others_wrote_as_text(tmp_path):
    name = "<b>&'anna'"
    text = "<script>alert(1)</script>"
    bad = f"``` [x](javascript:alert(1))\n[x]: javascript:\n{text}"
    grid = Grid(["", bad], [[bad, bad]], frozenset({0}), colours={bad: '"><script>'})
    report = parts(Heading(bad), Paragraph(bad), Code(bad), grid)
    # What a submission's process says may be anything.
    orders = {bad: {"dt": [1.0, text], "expected": bad, "quantities": {text: {"errors": bad}}}}
    changes = {"message": text, "report": report, "orders": orders, "verdict": '"><script>'}
    rows = rows_of(other(name, **changes))
    write_pages(rows, RUBRIC, tmp_path)
    book = (tmp_path / "gradebook.html").read_text()
    assert "<script>alert" not in book
    assert "<b>" not in book
    assert "&lt;script&gt;alert(1)" in book
    # The one script is ropeode's own, and the browser runs no other.
    (script,) = re.findall("(?s)<script>(.*?)</script>", book)
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert f"script-src 'sha256-{digest}'" in book
    page = (tmp_path / f"feedback/{name}.html").read_text()
    assert "5 of 5 points" in page
    assert "script-src 'none'" in page
    assert not re.search("<(b|script)>", page)
    text = (tmp_path / f"feedback/{name}.md").read_text()
    assert text.startswith("# &lt;b>&'anna'\n")
    code, rest = re.findall("(?s)````python(.*?)\n````", text), text.replace(bad, "")
    assert code == [f"\n{bad}"]
    assert not re.search(r"<script|\]\(|\]:", rest)


def convergence(errors, observed):
    found = {"position": {"errors": errors, "observed": observed}}
    return {"dt": [0.1, 0.05, 0.025, 0.0125], "expected": 2, "quantities": found}


CONVERGENCE = convergence([None, 4e-2, 1e-2, 0.0], 2.0)


@pytest.fixture
def order_plot(tmp_path):
    """The picture of a check of order in the feedback; empty where there is none."""

    def draw(found):
        write_pages(rows_of(other("anna", orders={"order-free": found})), RUBRIC, tmp_path)
        page = (tmp_path / "feedback/anna.html").read_text()
        return "".join(re.findall("(?s)<svg.*?</svg>", page))

    return draw


def test_the_order_plot_has_a_mark_for_each_error(order_plot):
    drawn = order_plot(CONVERGENCE)
    # One more stands beside its name.
    assert drawn.count("<circle") == 2 + 1
    assert "dashed: order 2" in drawn
    assert "position: order 2.00" in drawn
    assert order_plot(convergence([None] * 4, None)) == ""
    assert "dashed" not in order_plot({**CONVERGENCE, "expected": None})


def test_the_dashed_line_is_that_of_the_expected_order(order_plot):
    """Errors of order 2 lie on it, and all of it is in the picture."""
    dashed = "<line [^>]*stroke-dasharray[^>]*>"
    drawn = order_plot(CONVERGENCE)
    (line,) = re.findall(dashed, drawn)
    (points,) = re.findall(r'points="([^"]*)"', drawn)
    x1, y1, x2, y2 = re.findall(r'[xy][12]="([^"]*)"', line)
    assert {f"{x1},{y1}", f"{x2},{y2}"} == {*points.split()}
    (line,) = re.findall(dashed, order_plot(convergence([1.0] * 4, 0.0)))
    (low,) = re.findall(r'y2="([^"]*)"', line)
    assert 0.0 < float(low) < 270.0 - 42.0


def test_the_picture_is_that_of_the_check_that_failed(tmp_path):
    orders = {"order-damped": CONVERGENCE, "order-free": CONVERGENCE}
    findings = {"order-damped": "pass", "order-free": "fail"}
    write_pages(rows_of(other("anna", orders=orders, findings=findings)), RUBRIC, tmp_path)
    assert "Errors over step sizes, order-free" in (tmp_path / "gradebook.html").read_text()
    assert "<h2>Errors: order-free</h2>" in (tmp_path / "feedback/anna.html").read_text()
