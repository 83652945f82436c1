"""What `ropeode grade --init` writes works as it is, and the command says what it should."""

from __future__ import annotations

import json
import re
import shutil
import subprocess

import numpy as np
import pytest
from trajectory_writing import finding, write_runs

from ropeode import grade
from ropeode.checking import samples_of, write_start
from ropeode.study import TableJob, read_spec
from tests.exact_reference import rope_reference

needs_compiler = pytest.mark.skipif(shutil.which("g++") is None, reason="needs g++")
IN_SPACE = {
    "num_nodes": 4, "start": [0.0, 1.0, 0.5], "end": [3.0, 1.0, 0.5], "gravity": [0, -1, 0.5],
    "pinned": [1, 3], "node_mass": [1, 2, 0.5, 1.5], "stiffness": [10.0, 20.0, 30.0],
    "damping": [0.0, 0.1, 0.2, 0.3],
    "initial_velocity": [[0, 1, 0], [0, 0, 0], [1, 0, 0], [0, 0, 0]],
}  # fmt: skip
ROPES = {"usual": {}, "in space": {"frames": 3, "accuracy": 1e-5, "rope": IN_SPACE}}
OTHERS = {
    "rigid": {"kind": "inextensible-rope", "rope": {"num_nodes": 3}},
    "lorenz": {"problem": "lorenz", "frames": 2},
    "stored": {"reference": "pleiades"},
}


@pytest.mark.parametrize("name", [*ROPES, *OTHERS])
def test_spec_and_initial_state_are_those_of_the_problem(tmp_path, name):
    job = TableJob({**ROPES, **OTHERS}[name])
    written = write_start(tmp_path / "new", job)
    again = TableJob(read_spec(tmp_path / "new" / "spec.toml"))
    assert again.problem.parameters == job.problem.parameters
    assert again.spec.asked == job.spec.asked
    state = np.loadtxt(tmp_path / "new" / "initial.csv", delimiter=",", skiprows=1, ndmin=2)
    assert np.array_equal(state[:, 2:], samples_of(job.problem, job.problem.y0[None])[0])
    assert [path.endswith("rope.cpp") for path in written].count(True) == (name in ROPES)
    page = (tmp_path / "new" / "README.md").read_text()
    assert not re.search("@[A-Z]+@", page)
    assert ("rope.cpp" in page) == (name in ROPES)


def test_a_problem_in_a_file_is_found_from_anywhere(tmp_path):
    (tmp_path / "own.py").write_text(
        "from ropeode import Rope\n\n\ndef mine(frames=2):\n"
        "    return Rope(num_nodes=2).problem(frames)\n"
    )
    write_start(tmp_path / "new", TableJob({"problem": "own.py:mine", "frames": 3}, tmp_path))
    again = TableJob(read_spec(tmp_path / "new" / "spec.toml"), tmp_path / "new")
    assert again.problem.frames == 3


def commands_of(page):
    """The commands of the section on the program, without the last, which grades."""
    block = page.split("```sh\n")[-1].split("```")[0].splitlines()
    assert block[-1].startswith("ropeode grade ")
    return block[:-1], block[-1].split()


@needs_compiler
@pytest.mark.slow
def test_the_program_is_right_and_a_wrong_one_is_not(tmp_path):
    job = TableJob(ROPES["in space"])
    write_start(tmp_path / "new", job)
    folder, source = tmp_path / "new", tmp_path / "new" / "rope.cpp"
    page = (folder / "README.md").read_text()
    commands, graded = commands_of(page)
    commands[0] = commands[0].replace("g++ -O2", "g++ -O0 -Wall -Wextra -Werror")
    known = rope_reference(job.problem)

    def report(text, **options):
        source.write_text(text)
        for command in commands:
            subprocess.run(command, shell=True, check=True, cwd=folder)
        files = [folder / name for name in graded if name.endswith(".csv")]
        return grade(files, known, expected_order=2, **options)

    right = source.read_text()
    orders = finding(report(right)).convergence.orders.values()
    assert all(order.observed == pytest.approx(2, abs=0.1) for order in orders)
    # As the page says.
    line = re.search("delete the line `(.*)`", page)[1]
    assert right.count(line) == 1
    wrong = report(right.replace(line, ""), diagnose=False)
    assert [each.check for each in wrong.failed] == ["order"]


def test_the_command_grades_with_the_spec(run, tmp_path, small_rope):
    write_start(tmp_path / "new", TableJob({"frames": 3, "rope": {"num_nodes": 4}}))
    spec = ["--problem", str(tmp_path / "new" / "spec.toml"), "--order", "2"]
    for stepper, passes in (("velocity-verlet", True), ("explicit-euler", False)):
        made = write_runs(tmp_path, small_rope, stepper, (128, 256, 512), ".csv")
        done = run("grade", *map(str, made), *spec, "--format", "json")
        assert done.returncode == (0 if passes else 1)
        assert json.loads(done.stdout)["passed"] is passes


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ("", "files: 'none' given; .* see `ropeode grade --init DIR`"),
        ("a.csv", "problem: 'none' given"),
        ("a.csv --problem no.toml", "spec: 'no.toml' given"),
        ("a.csv --init new", "init: 'new' given; allowed: no other option but those of"),
        ("a.csv --problem x --out no/such.md", "out: "),
        ("--init new --assignment games102", "is not 'games101'"),
        ("a.csv --assignment games101", "'games101' given; allowed: one with --init"),
        ("--init new --assignment games101 --frames 3", "no problem beside it"),
        ("--init new --assignment games101 --order 1", "no other option but"),
        ("--init old", "old' given; allowed: a new folder"),
        ("--init no/such", "in a folder that exists"),
        ("--init old --assignment games101", "old' given; allowed: a new folder"),
    ],
)
def test_wrong_use_writes_nothing(run, tmp_path, given, words):
    (tmp_path / "old").mkdir()
    done = run("grade", *given.split())
    assert done.returncode == 2
    assert re.search(words, done.stderr)
    assert [path.name for path in tmp_path.rglob("*")] == ["old"]
