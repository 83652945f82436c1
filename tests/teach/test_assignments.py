"""What the rubrics of docs/teach give for stubs, solutions and typical hand-ins."""

from __future__ import annotations

import csv
import re
import shlex

import pytest

from ropeode.classroom import OF_STEPPERS, read_rubric
from tests.teach.hand_ins import TEACH, WRONG, text_of

ROW = re.compile(r"^\| *(\w+) *\| *(.+?) *\| *([\d.]+) *\| *(.+?) *\|$", re.MULTILINE)


def expected(assignment):
    """By hand-in: its points, and what the grade book says of it, as the page has them."""
    rows = ROW.findall((TEACH / "answers.md").read_text())
    return {name: (points, says) for kind, name, points, says in rows if kind == assignment}


def command(assignment):
    """The command of a rubric, without `ropeode`."""
    return shlex.split((TEACH / assignment / "rubric.toml").read_text().splitlines()[0])[2:]


@pytest.mark.parametrize("assignment", WRONG)
def test_a_rubric_gives_ten_points_and_the_page_has_each_hand_in(assignment):
    rubric = read_rubric(TEACH / assignment / "rubric.toml", OF_STEPPERS)
    assert sum(item.points for item in rubric) == 10.0
    assert set(expected(assignment)) == {"stub", "solution", *WRONG[assignment]}
    words = command(assignment)
    assert words[:2] == ["check", "FOLDER"]
    claims = words[4 : words.index("--rubric")]
    for file in ("stub", "solution"):
        assert f"ropeode check {file}.py {shlex.join(claims)}\n" in text_of(assignment, file)
    assert f"ropeode check mine.py {shlex.join(claims)}\n" in (
        (TEACH / assignment / "sheet.md").read_text()
    )


@pytest.mark.slow
@pytest.mark.parametrize("assignment", WRONG)
def test_hand_ins_have_the_points_and_the_message_of_the_page(run, tmp_path, assignment):
    hand_ins = {name.replace(" ", "-"): name for name in expected(assignment)}
    (tmp_path / "class").mkdir()
    for file, name in hand_ins.items():
        (tmp_path / "class" / f"{file}.py").write_text(text_of(assignment, name))
    places = {"FOLDER": "class", "rubric.toml": str(TEACH / assignment / "rubric.toml")}
    done = run(*[places.get(word, word) for word in command(assignment)], "--format", "csv")
    rows = {hand_ins[row["submission"]]: row for row in csv.DictReader(done.stdout.splitlines())}
    for name, (points, says) in expected(assignment).items():
        row = rows[name]
        assert row["points"] == points, row
        if says == "right":
            assert (row["verdict"], row["message"]) == ("right", "")
        else:
            assert row["verdict"] == ("" if row["status"] == "raised" else "wrong")
            assert says in row["message"], row
