"""The files for Assignment 8 of GAMES101, and the tutorial that grades them."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import ropeode
from ropeode import grade, reference
from ropeode.checking import ASSIGNMENTS, samples_of, write_assignment
from ropeode.cli import cli
from ropeode.errors import InputError
from ropeode.study import TableJob, read_spec

SOURCE = Path(ropeode.__file__).parent / "checking" / "starter_files" / "games101"
TUTORIAL = Path(__file__).parents[2] / "docs" / "tutorials" / "grade-cpp.md"
needs_compiler = pytest.mark.skipif(shutil.which("g++") is None, reason="needs g++")


def test_specs_and_initial_state(tmp_path):
    names = {Path(each).name for each in write_assignment(tmp_path / "mine", "games101")}
    assert names == {"springs.toml", "rigid.toml", "initial.csv", "README.md", "rope.cpp"}
    first = np.loadtxt(tmp_path / "mine" / "initial.csv", delimiter=",", skiprows=1)
    kinds = []
    for name in ASSIGNMENTS["games101"]:
        problem = TableJob(read_spec(tmp_path / "mine" / name)).problem
        kinds.append(problem.parameters["kind"])
        assert (problem.frames, problem.parameters["damping"]) == (20, 0.0)
        assert np.array_equal(first[:, 2:], samples_of(problem, problem.y0[None])[0])
    assert kinds == ["rope", "inextensible-rope"]


def test_nothing_is_overwritten(tmp_path):
    (tmp_path / "mine").mkdir()
    with pytest.raises(InputError, match="mine' given; allowed: a new folder"):
        write_assignment(tmp_path / "mine", "games101")
    assert list((tmp_path / "mine").iterdir()) == []


def test_unknown_assignments(tmp_path):
    with pytest.raises(
        InputError, match="assignment: 'games102' given, which does not exist; allowed: games101"
    ):
        write_assignment(tmp_path / "mine", "games102")
    assert not (tmp_path / "mine").exists()
    (option,) = (each for each in cli.commands["grade"].params if each.name == "assignment")
    assert tuple(ASSIGNMENTS) == tuple(option.type.choices)


@pytest.mark.usefixtures("command_surroundings")
@pytest.mark.parametrize(
    ("given", "words"),
    [
        (["--init", "mine", "--assignment", "games102"], "is not 'games101'"),
        (["a.csv", "--assignment", "games101"], "'games101' given; allowed: one with --init"),
        (["--init", "mine", "--assignment", "games101", "--frames", "3"], "no problem beside it"),
        (["--init", "mine", "--assignment", "games101", "--order", "1"], "no other option but"),
    ],
)
def test_wrong_use(given, words):
    with pytest.raises(Exception, match=words):
        cli.main(["grade", *given], standalone_mode=False)


@pytest.fixture(scope="module")
def mine(tmp_path_factory):
    """The folder as the command writes it."""
    folder = tmp_path_factory.mktemp("games101") / "mine"
    write_assignment(folder, "games101")
    return folder


@pytest.fixture(scope="module")
def known(mine):
    """The references of both specs."""
    names = ASSIGNMENTS["games101"]
    return {name: reference(TableJob(read_spec(mine / name)).problem) for name in names}


def compiled(folder, source, program="rope", warnings=("-Wall", "-Wextra", "-pedantic", "-Werror")):
    """A program, compiled without a warning."""
    path = folder / f"{program}.cpp"
    path.write_text(source)
    line = ["g++", "-O2", "-std=c++17", *warnings, "-o", folder / program, path]
    subprocess.run(line, check=True)
    return folder / program


def runs_of(program, method, steps):
    """Files that it prints."""
    files = []
    for n in steps:
        done = subprocess.run(
            [program, *method, str(n)], check=True, capture_output=True, text=True
        )
        files.append(program.parent / f"{'-'.join([program.name, *method])}-{n}.csv")
        files[-1].write_text(done.stdout)
    return files


def methods_in(page):
    """The rows of the table of methods: name, spec, order, steps per frame."""
    rows = re.findall(r"^\| `(.*?)` \| `(.*?)` \| (\d) \| ([\d ]+) \|$", page, re.MULTILINE)
    return [(name, spec, int(order), steps.split()) for name, spec, order, steps in rows]


METHODS = methods_in((SOURCE / "page.md").read_text())


def test_the_page_lists_the_methods_of_the_program():
    in_program = re.findall(r'\{"([a-z-]+)", \[&\]', (SOURCE / "rope.cpp").read_text())
    assert [name for name, *_ in METHODS] == in_program
    assert len(in_program) == 4


@needs_compiler
@pytest.mark.slow
@pytest.mark.parametrize(("method", "spec", "order", "steps"), METHODS)
def test_each_method_has_its_order(mine, known, method, spec, order, steps):
    program = compiled(mine, (mine / "rope.cpp").read_text())
    report = grade(runs_of(program, [method], steps), known[spec], expected_order=order)
    assert report.passed
    observed = report.findings[1].convergence.orders["position"].observed
    assert observed == pytest.approx(order, abs=0.05)
    # Against the other rope it is wrong, and the report says so.
    (other,) = set(known) - {spec}
    report = grade(runs_of(program, [method], steps), known[other], expected_order=order)
    assert report.verdict == "wrong"
    assert report.diagnosis[0].cause == "other-rope"


@needs_compiler
@pytest.mark.slow
def test_the_program_refuses_what_it_does_not_know(mine):
    program = compiled(mine, (mine / "rope.cpp").read_text())
    for given in (["verlet", "64"], ["verlet-forces", "0"], ["verlet-forces"], []):
        done = subprocess.run([program, *given], capture_output=True, text=True, check=False)
        assert done.returncode == 2
        assert done.stdout == ""
        assert all(name in done.stderr for name, *_ in METHODS)


@needs_compiler
@pytest.mark.slow
def test_the_lines_for_the_classes_of_the_assignment(mine, known):
    """They compile with classes of these names, and print what the program prints."""
    source = (mine / "rope.cpp").read_text()
    page = (mine / "README.md").read_text()
    (lines,) = re.findall(r"```cpp\n(.*?)```", page, re.DOTALL)
    classes = source[: source.index("int main(")]
    lines = lines.replace('#include "rope.h"', "").replace("CGL::", "")
    program = compiled(mine, classes + lines, "print")
    printed = runs_of(program, [], ["64"])[0].read_text()
    usual = compiled(mine, source)
    assert printed == runs_of(usual, ["semi-implicit-euler"], ["64"])[0].read_text()


def changed(source, *changes):
    for old, new in changes:
        assert source.count(old) == 1, old
        source = source.replace(old, new)
    return source


@needs_compiler
@pytest.mark.slow
def test_what_the_page_says_of_mistakes(mine, known):
    source, springs = (mine / "rope.cpp").read_text(), known["springs.toml"]

    # A start that is of order 2.
    taylor = changed(
        source,
        (
            "    std::cout.precision(17);",
            '    if (chosen->first == "verlet-forces")\n'
            "        for (auto& m : rope.masses)\n"
            "            if (!m->pinned)\n"
            "                m->last_position = m->position + gravity * (0.5 / n / n);\n"
            "    std::cout.precision(17);",
        ),
    )
    files = runs_of(compiled(mine, taylor, "taylor"), ["verlet-forces"], [32, 64, 128, 256])
    report = grade(files, springs, expected_order=2)
    assert report.passed
    # Positions in float.
    single = changed(source, ("(double(i) / (num_nodes - 1))", "(float(i) / (num_nodes - 1))"))
    files = runs_of(compiled(mine, single, "single"), ["verlet-forces"], [32, 64, 128])
    with pytest.raises(
        InputError,
        match="initial state, node 1 .*right in single precision. Fix: compute it in double",
    ):
        grade(files, springs)
    # A factor in each step.
    damped = changed(
        source,
        ("+= (now - m->last_position)", "+= (now - m->last_position) * (1 - 0.00005)"),
    )
    files = runs_of(compiled(mine, damped, "damped"), ["verlet-forces"], [256, 512, 1024, 2048])
    (diagnosis,) = grade(files, springs, expected_order=1).diagnosis
    assert diagnosis.cause == "damping-per-step"
    # A spring that pulls at one end.
    line = re.search("delete the line `(.*?)`", (mine / "README.md").read_text())[1]
    one_end = compiled(mine, changed(source, (line, "")), "one_end")
    files = runs_of(one_end, ["semi-implicit-euler"], [32, 64, 128, 256])
    assert grade(files, springs, expected_order=1, diagnose=False).verdict == "wrong"
    # Coarse files of explicit Euler.
    files = runs_of(compiled(mine, source), ["explicit-euler"], [64, 128, 256, 512])
    report = grade(files, springs, expected_order=1)
    assert report.verdict == "undetermined"
    assert "add runs with 1024 and 2048 steps per frame" in report.findings[1].line
    files += runs_of(mine / "rope", ["explicit-euler"], [1024, 2048])
    assert grade(files, springs, expected_order=1).passed


def without_measurements(text):
    """Without the parts that differ between machines: seconds, and uncertainties by rounding."""
    text = re.sub(r" \(\d+\.\d s\)", "", text)
    return " ".join(re.sub(r"± [\d.e+-]+", "±", text).split())


class Reader:
    """Does what a tutorial says, in an empty folder.

    Arguments:
        folder: in which it begins.
        commands: a folder in which the shell looks for `ropeode`.
    """

    def __init__(self, folder, commands):
        self.folder, self.output = folder, ""
        self.path = f"{commands}:{os.environ['PATH']}"

    def sh(self, block):
        """Run a block in a shell, and stay in the folder that it goes to."""
        done = subprocess.run(
            ["bash", "-e", "-c", f"{block}\npwd >&2"],
            cwd=self.folder,
            env={**os.environ, "PATH": self.path},
            capture_output=True,
            text=True,
            check=True,
        )
        self.output, self.folder = done.stdout, Path(done.stderr.splitlines()[-1])

    def text(self, block):
        """What the commands before it have printed."""
        assert without_measurements(self.output) == without_measurements(block)

    def diff(self, block):
        """Change lines of the program."""
        lines = block.splitlines()
        old, new = (
            "\n".join(line[1:] for line in lines if line[0] in kept) for kept in (" -", " +")
        )
        source = self.folder / "rope.cpp"
        source.write_text(changed(source.read_text(), (old, new)))


@needs_compiler
@pytest.mark.slow
def test_the_tutorial(tmp_path):
    """As a reader does: block after block, in an empty folder, with what is printed compared."""
    command = tmp_path / "bin" / "ropeode"
    command.parent.mkdir()
    command.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m ropeode "$@"\n')
    command.chmod(0o755)
    (tmp_path / "empty").mkdir()
    reader = Reader(tmp_path / "empty", command.parent)
    blocks = re.findall(r"^```(\w+)\n(.*?)^```", TUTORIAL.read_text(), re.DOTALL | re.MULTILINE)
    assert {kind for kind, _ in blocks} == {"sh", "text", "diff"}
    for kind, block in blocks:
        getattr(reader, kind)(block)


@needs_compiler
@pytest.mark.slow
def test_the_answers_of_the_tutorial(mine, known):
    source, text = (mine / "rope.cpp").read_text(), TUTORIAL.read_text()

    def largest(report):
        return [float(f"{e:.2g}") for e in report.findings[1].convergence.errors["position"]]

    # A spring that pulls at one end.
    program = compiled(mine, changed(source, ("        s.m2->forces -= pull;\n", "")), "one_end")
    files = runs_of(program, ["semi-implicit-euler"], [32, 64, 128, 256])
    report = grade(files, known["springs.toml"], expected_order=1)
    assert largest(report) == [180.0] * 4
    assert "The error is 1.8e+02 at each step size." in text
    assert "as if the spring force is left out" in report.diagnosis[0].line
    # Damping in each step.
    old = "(now - m->last_position)"
    new = "(now - m->last_position) * (1 - 0.00005)"
    assert f"`{new}`" in text
    program = compiled(mine, changed(source, (old, new)), "damped")
    files = runs_of(program, ["verlet-forces"], [256, 512, 1024, 2048])
    report = grade(files, known["springs.toml"], expected_order=1)
    errors = report.findings[1].convergence.errors["position"]
    assert [round(e) for e in errors] == [20, 38, 66, 106]
    assert "steps: 20, 38, 66 and 106" in text
    assert report.diagnosis[0].cause == "damping-per-step"
    # Two sweeps.
    old = "        restoreLengths();\n"
    program = compiled(mine, changed(source, (old, f"    {{\n{old}{old}    }}\n")), "two_sweeps")
    files = runs_of(program, ["verlet-constraints"], [128, 256, 512, 1024])
    line = grade(files, known["rigid.toml"], expected_order=1).findings[1].line
    assert "order 1.01 [0.99, 1.02]" in line
    assert "order 1.01 [0.99, 1.02]" in text
    # Six digits.
    few = re.sub(r"    std::cout.precision\(17\);.*\n", "", source)
    program = compiled(mine, few, "few_digits")
    files = runs_of(program, ["verlet-forces"], [32, 64, 128, 256])
    assert grade(files, known["springs.toml"], expected_order=1).passed
    files = runs_of(program, ["verlet-forces"], [1024, 2048, 4096])
    report = grade(files, known["springs.toml"], expected_order=1)
    assert report.verdict == "undetermined"
    assert "write 17 digits" in report.findings[1].line
