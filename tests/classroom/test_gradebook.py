"""The rows of a grade book; its forms are held by files."""

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

from ropeode.classroom import Item, Outcome, Submission, as_text, grade_book, parts, write_pages
from ropeode.render import Code, Grid, Heading, Paragraph, formatted
from tests.golden import check_golden

RUBRIC = (Item("runs", 2.0), Item("pins | <b>", 3.0, ("pins",)))
RIGHT = Outcome("anna", "checked", "right", 1.98, findings={"pins": "pass"}, behaviour="one")


def book_of(*outcomes):
    submissions = [Submission(each.name, (f"{each.name}.py",), "", "") for each in outcomes]
    return grade_book(submissions, outcomes, RUBRIC)


def other(name, **changes):
    return dataclasses.replace(RIGHT, name=name, **changes)


def test_points_and_marks():
    wrong = other("bert", verdict="wrong", findings={"pins": "fail"}, behaviour="two")
    crashed = other("dora", status="crashed", verdict="wrong", behaviour="")
    rows = book_of(RIGHT, wrong, other("carla"), crashed, other("emil", behaviour="")).rows
    assert [row.points for row in rows] == [5.0, 2.0, 5.0, 0.0, 5.0]
    # Of two whose behaviour is not known, nobody can say that they behave alike.
    assert [row.marks for row in rows] == [("same as carla",), (), ("same as anna",), (), ()]
    # Of many, some are named.
    assert book_of(*map(other, "abcdefgh")).rows[0].marks == ("same as b, c, d, e, f and 2 more",)
    assert book_of(*map(other, "abcdef")).rows[5].marks == ("same as a, b, c, d, e",)


def test_the_exit_code():
    for *verdicts, code in (
        *(("right", "right", 0), ("right", "wrong", 1)),
        *(("wrong", "undetermined", 2), ("right", "", 2)),
    ):
        assert (
            book_of(*(other(str(n), verdict=it) for n, it in enumerate(verdicts))).exit_code == code
        )


@pytest.mark.parametrize("first", "=+-@\t\r")
def test_no_text_of_others_is_a_formula(first):
    formula = other(f"{first}1+1", order=-0.25, message=f'{first}a "b", c')
    *_, row = csv.reader(io.StringIO(formatted(book_of(RIGHT, formula), "csv"), newline=""))
    assert not {row[0][0], row[5][0]} & {*"=+-@\t\r"}
    assert row[0].endswith("1+1")
    assert row[5].endswith('a "b", c')
    assert row[3] == "-0.25"


def convergence(errors, observed, expected=2):
    found = {"position": {"errors": errors, "observed": observed}}
    return {"dt": [0.1, 0.05, 0.025, 0.0125], "expected": expected, "quantities": found}


FALLING = convergence([None, 4e-2, 1e-2, 0.0], 2.0)
# The picture is that of the check that failed; without errors there is none.
ORDERS = {"order-damped": FALLING, "order-free": convergence([1.0] * 4, 0.0)}
FOUND = {"order-damped": "pass", "order-free": "fail", "pins": "fail"}
REPORT = parts(Heading("Check of bert"), Grid(["", "pins"], [["no", "wrong"]], frozenset({1})))
WRONG = {"verdict": "wrong", "findings": FOUND, "orders": ORDERS, "report": REPORT}
UNEVEN = convergence([4e-2, None, 1e-2, 5e-3], None, None)
CLASS = (
    other("anna", orders={"order-damped": FALLING}),
    other("bert", order=-0.25, message="ä", behaviour="", **WRONG),
    other("carla", order=10.0, behaviour="", orders={"order": UNEVEN}),
    other(
        "dora", order=None, verdict="undetermined", orders={"order": convergence([None] * 4, None)}
    ),
    Outcome("e" * 60, "out of memory", message="m" * 200),
)


def test_its_forms_are_those_of_the_files(tmp_path):
    book = book_of(*CLASS)
    write_pages(book, tmp_path)
    for end in ("csv", "json", "html"):
        check_golden(f"gradebook.{end}", (tmp_path / f"gradebook.{end}").read_text())
    for end in ("html", "md"):
        check_golden(f"gradebook-feedback.{end}", (tmp_path / f"feedback/bert.{end}").read_text())
    text = as_text(book)
    check_golden("gradebook.txt", text)
    assert max(map(len, text.splitlines())) == 80
    # Every key is documented.
    page = (Path(__file__).parents[2] / "docs/howto/classroom.md").read_text()
    form = json.loads((tmp_path / "gradebook.json").read_text())
    assert all(f"`{word}`" in page for word in (*form, *form["submissions"][0], form["schema"]))


def test_pages_show_what_others_wrote_as_text(tmp_path):
    name = "<b>&'anna'"
    text = "<script>alert(1)</script>"
    bad = f"``` [x](javascript:alert(1))\n[x]: javascript:\n{text}"
    grid = Grid(["", bad], [[bad, bad]], frozenset({0}), colours={bad: '"><script>'})
    report = parts(Heading(bad), Paragraph(bad), Code(bad), grid)
    # What a submission's process says may be anything.
    orders = {bad: {"dt": [1.0, text], "expected": bad, "quantities": {text: {"errors": bad}}}}
    changes = {"message": text, "report": report, "orders": orders, "verdict": '"><script>'}
    write_pages(book_of(other(name, **changes)), tmp_path)
    book = (tmp_path / "gradebook.html").read_text()
    assert "<script>alert" not in book
    assert "<b>" not in book
    assert "&lt;script&gt;alert(1)" in book
    # The one script is ropeode's own, and the browser runs no other.
    (script,) = re.findall("(?s)<script>(.*?)</script>", book)
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert f"script-src 'sha256-{digest}'" in book
    page = (tmp_path / f"feedback/{name}.html").read_text()
    assert "script-src 'none'" in page
    assert not re.search("<(b|script)>", page)
    text = (tmp_path / f"feedback/{name}.md").read_text()
    assert text.startswith("# &lt;b>&'anna'\n")
    code, rest = re.findall("(?s)````python(.*?)\n````", text), text.replace(bad, "")
    assert code == [f"\n{bad}"]
    assert not re.search(r"<script|\]\(|\]:", rest)
