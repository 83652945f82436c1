"""What the rubrics of docs/teach give for stubs, solutions and typical hand-ins."""

from __future__ import annotations

import csv
import re
import shlex
from pathlib import Path

import pytest

from ropeode.classroom import OF_STEPPERS, read_rubric

TEACH = Path(__file__).parents[2] / "docs/teach"

_FORCES = "    return force - args.damping[:, None] * v\n"
# By assignment and by the words of docs/teach/index.md: old and new text.
WRONG: dict[str, dict[str, tuple[tuple[str, str], ...]]] = {
    "euler": {
        "explicit Euler": (("x_new = x + dt * v_new", "x_new = x + dt * v"),),
        "one end of each spring": (("            force[s + 1] -= pull\n", ""),),
        "no damping": ((_FORCES, "    return force\n"),),
        "forces without mass": ((" / args.mass[:, None]\n    v_new", "\n    v_new"),),
    },
    "verlet": {
        "the half missing": (("dt**2 / 2 * a", "dt**2 * a"),),
        "the old velocity in the damping": (("x_new, v + dt * a, args", "x_new, v, args"),),
        "Heun": (("x_new, v + dt * a, args", "x + dt * v, v + dt * a, args"),),
        "damping factor in each step": (
            ("    a = acc", "    args = args._replace(damping=0 * args.damping)\n    a = acc"),
            ("v_new = v + dt / 2", "v_new = (1 - 0.00005) * v + dt / 2"),
        ),
    },
    "constraint": {
        "springs that do not give": (
            ("softness = 1 / (args.stiffness[s] * dt**2)", "softness = 0"),
        ),
        "forgets what it has pulled": (("    impulse[s] += change\n", ""),),
        "velocities of the prediction": (("return x_new, (x_new - x) / dt", "return x_new, v"),),
        "assignment 1 again": (),
        "half of the way for each end": (
            ("x_new[s] += first *", "x_new[s] += (first + second) / 2 *"),
            ("x_new[s + 1] -= second *", "x_new[s + 1] -= (first + second) / 2 *"),
        ),
    },
}


# A solution of another assignment, handed in.
ANOTHER = {"assignment 1 again": "euler"}


def text_of(assignment: str, hand_in: str) -> str:
    """The text of a hand-in; `stub` and `solution` are files."""
    if hand_in in ("stub", "solution"):
        return (TEACH / assignment / f"{hand_in}.py").read_text()
    text = text_of(ANOTHER.get(hand_in, assignment), "solution")
    for old, new in WRONG[assignment][hand_in]:
        assert text.count(old) == 1, f"{old!r} stands {text.count(old)} times"
        text = text.replace(old, new)
    return text


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
