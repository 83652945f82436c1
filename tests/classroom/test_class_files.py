"""A folder of trajectories: each submission has its row, and all share one reference."""

from __future__ import annotations

import pytest

from ropeode import grade, reference
from ropeode.classroom import OF_FILES, REFERENCE, Trajectories, examined, trajectory_submissions
from ropeode.problems import Rope
from ropeode.references import Reference, save_reference
from ropeode.render import markdown
from ropeode.simulation import simulate
from tests.checking.trajectory_writing import write_runs
from tests.classroom.conftest import rows_in, times

STEPS = (16, 32, 64, 128)
PROBLEM = {"problem": "rope", "frames": "3", "rope": {"num_nodes": "4"}}
WORDS = ("--problem", "rope", "--num-nodes", "4", "--frames", "3", "--order", "2")


def write(folder, problem, method="velocity-verlet", steps=STEPS, suffix=".csv", **how):
    """What a program prints, one file for each number of steps."""
    folder.mkdir(parents=True, exist_ok=True)
    write_runs(folder, problem, method, steps, suffix, **how)


@pytest.mark.slow
def test_each_submission_has_its_row_and_is_not_graded_again(run, tmp_path, small_rope):
    (tmp_path / "class/empty").mkdir(parents=True)
    write(tmp_path / "class/right/my project", small_rope)
    write(tmp_path / "class/undamped", Rope(num_nodes=4, damping=0.0).problem(frames=3))
    done = run("grade", "class", *WORDS, "-o", "out")
    assert (done.returncode, done.stdout) == (2, "")
    rows = rows_in(tmp_path / "out")
    assert {name: (row["status"], row["verdict"], row["points"]) for name, row in rows.items()} == {
        "empty": ("refused", "", "0"),
        "right": ("checked", "right", "10"),
        "undamped": ("checked", "wrong", "2"),
    }
    assert "the damping is left out" in rows["undamped"]["message"]
    page = (tmp_path / "out/feedback/undamped.html").read_text()
    assert "Fix: a_damping = -damping * v / mass" in page
    assert "Errors over step sizes, order" in page

    write(tmp_path / "class/empty", small_rope, "rk4")
    before = times(tmp_path / "out/results")
    run("grade", "class", *WORDS, "-o", "out")
    changed = before.items() ^ times(tmp_path / "out/results").items()
    assert {name for name, _ in changed} == {"empty.json"}
    assert rows_in(tmp_path / "out")["empty"]["verdict"] == "right"


@pytest.fixture(scope="module")
def known(small_rope):
    return reference(small_rope)


def outcomes(folder, known):
    """What becomes of the submissions where this reference is laid ready for all of them."""
    shared = folder.with_name("shared")
    shared.mkdir(exist_ok=True)
    save_reference(known, shared / REFERENCE)
    grading = {"dts": None, "expected_order": 2, "method": None}
    asked = {"values": PROBLEM, "folder": ".", "arguments": grading, "truth": ""}
    asked = Trajectories(2048.0, time_limit=60.0, **asked)
    return {
        each.name: examined(each.name, each.where, folder, asked, shared, lambda text: None)
        for each in trajectory_submissions(folder)
    }


def test_files_are_judged_as_by_the_command(tmp_path, known, small_rope):
    folder = tmp_path / "class"
    write(folder / "anna", small_rope)
    write(folder / "bert", small_rope, suffix=".npz")
    write(folder / "carla", small_rope, digits="%.12g")
    write(folder / "dora", small_rope, steps=STEPS[:3])
    found = outcomes(folder, known)
    assert {(each.status, each.verdict) for each in found.values()} == {("checked", "right")}
    assert found["anna"].order == pytest.approx(2.0, abs=0.05)
    # The names that a rubric may use are all there are.
    assert tuple(found["anna"].findings) == OF_FILES
    report = grade(sorted((folder / "anna").iterdir()), known, expected_order=2)
    assert found["anna"].findings == {each.check: each.status for each in report.findings}
    # Behaviour is what the files say at the samples.
    behaviours = {name: each.behaviour for name, each in found.items()}
    assert behaviours["anna"] == behaviours["bert"] != ""
    assert len({*behaviours.values()}) == 3


def test_what_is_right_is_told_by_the_reference_that_is_there(tmp_path, known):
    """No submission solves the problem again."""
    undamped = Rope(num_nodes=4, damping=0.0).problem(frames=3)
    write(tmp_path / "class/anna", undamped)
    states = simulate(undamped, "rk4", 512).states
    other = Reference(known.problem, states, known.certificate)
    assert outcomes(tmp_path / "class", other)["anna"].verdict == "right"


def test_files_that_cannot_be_read_are_refused(tmp_path, known, small_rope):
    folder = tmp_path / "class"
    write(folder / "mixed", small_rope)
    (folder / "mixed/32.csv").write_text("t,node\n")
    (folder / "mixed/64.csv").write_text("nonsense\n")
    found = outcomes(folder, known)["mixed"]
    assert (found.status, found.verdict, found.findings) == ("refused", "", {})
    assert found.message.startswith("mixed/32.csv, line 1")
    # Each fault is a line of the feedback, and none of them names a folder of the teacher's.
    text = markdown(found.blocks)
    assert text.count("Not checked: mixed/") == 2
    assert str(tmp_path) not in text
