"""What `ropeode grade --init` writes works as it is, and the command says what it should."""

from __future__ import annotations

import json
import re
import shutil
import subprocess

import numpy as np
import pytest
from click.testing import CliRunner

from ropeode import grade, reference
from ropeode.checking import samples_of, write_start
from ropeode.cli import cli
from ropeode.errors import InputError
from ropeode.study import TableJob, read_spec

ROPE = {"num_nodes": 4, "start": [0.0, 1.0, 0.5], "end": [3.0, 1.0, 0.5], "gravity": [0, -1, 0.5]}
ROPES = {
    "usual": {},
    "small": {
        "frames": 3,
        "accuracy": 1e-5,
        "rope": {"num_nodes": 4, "damping": [0.0, 0.1, 0.2, 0.3], "node_mass": [1, 2, 0.5, 1.5]},
    },
    "in space": {
        "frames": 3,
        "rope": {
            **ROPE,
            "pinned": [1, 3],
            "node_mass": [1.0, 2.0, 0.5, 1.5],
            "stiffness": [10.0, 20.0, 30.0],
            "damping": [0.0, 0.1, 0.2, 0.3],
            "initial_velocity": [[0, 1, 0], [0, 0, 0], [1, 0, 0], [0, 0, 0]],
        },
    },
}
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


def test_nothing_is_overwritten(tmp_path):
    (tmp_path / "old").mkdir()
    with pytest.raises(InputError, match="old' given; allowed: a new folder"):
        write_start(tmp_path / "old")
    with pytest.raises(InputError, match="in a folder that exists"):
        write_start(tmp_path / "no" / "such")
    assert [path.name for path in tmp_path.iterdir()] == ["old"]


needs_compiler = pytest.mark.skipif(shutil.which("g++") is None, reason="needs g++")


def commands_of(page):
    """The commands of the section on the program, without the last, which grades."""
    block = page.split("```sh\n")[-1].split("```")[0].splitlines()
    assert block[-1].startswith("ropeode grade ")
    return block[:-1], block[-1].split()


@needs_compiler
@pytest.mark.usefixtures("command_surroundings")
def test_the_program_is_right_and_a_wrong_one_is_not(tmp_path, monkeypatch):
    job = TableJob(ROPES["small"])
    write_start(tmp_path / "new", job)
    folder, source = tmp_path / "new", tmp_path / "new" / "rope.cpp"
    page = (folder / "README.md").read_text()
    commands, graded = commands_of(page)
    files = [folder / name for name in graded if name.endswith(".csv")]
    right = source.read_text()

    def run(text):
        source.write_text(text)
        commands[0] = commands[0].replace("g++ -O2", "g++ -O0 -Wall -Wextra -Werror")
        for command in commands:
            subprocess.run(command, shell=True, check=True, cwd=folder)

    run(right)
    known = reference(job.problem)
    report = grade(files, known, expected_order=2)
    assert report.passed
    assert all(abs(o.observed - 2) < 0.1 for o in report.findings[1].convergence.orders.values())
    # As the page says.
    line = re.search("delete the line `(.*)`", page)[1]
    assert right.count(line) == 1
    run(right.replace(line, ""))
    report = grade(files, known, expected_order=2, diagnose=False)
    assert [each.check for each in report.failed] == ["order"]

    # The command, on the wrong program's files; what it diagnoses has tests of its own.
    patched = "ropeode.checking.diagnosis.trajectories.diagnose_trajectories"
    monkeypatch.setattr(patched, lambda *_: ())
    paths = [str(path) for path in files]
    runner, given = CliRunner(), ["grade", *paths, "--problem", str(folder / "spec.toml")]
    done = runner.invoke(cli, [*given, "--order", "2", "--format", "json"], standalone_mode=False)
    assert done.return_value == 1
    assert json.loads(done.stdout)["passed"] is False
    assert runner.invoke(cli, [*given, "--out", str(tmp_path / "a.md")]).stdout == ""
    assert (tmp_path / "a.md").read_text().startswith("#")


@pytest.mark.usefixtures("command_surroundings")
@pytest.mark.parametrize(
    ("given", "words"),
    [
        ([], "files: 'none' given; .* see `ropeode grade --init DIR`"),
        (["a.csv"], "problem: 'none' given"),
        (["a.csv", "--problem", "no.toml"], "spec: 'no.toml' given"),
        (["a.csv", "--init", "new"], "init: 'new' given; allowed: no other option but those of"),
        (["a.csv", "--problem", "x", "--out", "no/such.md"], "out: "),
    ],
)
def test_wrong_use(given, words):
    with pytest.raises(InputError, match=words):
        cli.main(["grade", *given], standalone_mode=False)
