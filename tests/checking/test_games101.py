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
from ropeode import grade
from ropeode.checking import samples_of, write_assignment
from ropeode.study import TableJob, read_spec
from tests.exact_reference import rope_reference

SOURCE = Path(ropeode.__file__).parent / "checking" / "starter_files" / "games101"
TUTORIAL = Path(__file__).parents[2] / "docs" / "tutorials" / "grade-cpp.md"
SPECS = ("springs.toml", "rigid.toml")
needs_compiler = pytest.mark.skipif(shutil.which("g++") is None, reason="needs g++")


def test_specs_and_initial_state(tmp_path):
    names = {Path(each).name for each in write_assignment(tmp_path / "mine", "games101")}
    assert names == {"springs.toml", "rigid.toml", "initial.csv", "README.md", "rope.cpp"}
    first = np.loadtxt(tmp_path / "mine" / "initial.csv", delimiter=",", skiprows=1)
    kinds = []
    for name in SPECS:
        problem = TableJob(read_spec(tmp_path / "mine" / name)).problem
        kinds.append(problem.parameters["kind"])
        assert (problem.frames, problem.parameters["damping"]) == (20, 0.0)
        assert np.array_equal(first[:, 2:], samples_of(problem, problem.y0[None])[0])
    assert kinds == ["rope", "inextensible-rope"]


@pytest.fixture(scope="module")
def mine(tmp_path_factory):
    """The folder as the command writes it."""
    folder = tmp_path_factory.mktemp("games101") / "mine"
    write_assignment(folder, "games101")
    return folder


@pytest.fixture(scope="module")
def known(mine):
    """The references of both specs."""
    return {name: rope_reference(TableJob(read_spec(mine / name)).problem) for name in SPECS}


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


# The rows of the table of methods: name, spec, order, steps per frame.
METHODS = re.findall(
    r"^\| `(.*?)` \| `(.*?)` \| (\d) \| ([\d ]+) \|$",
    (SOURCE / "README.md").read_text(),
    re.MULTILINE,
)


def test_the_page_lists_the_methods_of_the_program():
    in_program = re.findall(r'\{"([a-z-]+)", \[&\]', (SOURCE / "rope.cpp").read_text())
    assert [name for name, *_ in METHODS] == in_program
    assert len(in_program) == 4


@pytest.fixture(scope="module")
def program(mine):
    return compiled(mine, (mine / "rope.cpp").read_text())


@needs_compiler
@pytest.mark.slow
@pytest.mark.parametrize(("method", "spec", "order", "steps"), METHODS)
def test_each_method_has_its_order(program, known, method, spec, order, steps):
    report = grade(
        runs_of(program, [method], steps.split()), known[spec], expected_order=int(order)
    )
    assert report.passed
    observed = report.findings[1].convergence.orders["position"].observed
    assert observed == pytest.approx(int(order), abs=0.05)


@needs_compiler
@pytest.mark.slow
def test_the_program_refuses_what_it_does_not_know(program):
    for given in (["verlet", "64"], ["verlet-forces", "0"], ["verlet-forces"], []):
        done = subprocess.run([program, *given], capture_output=True, text=True, check=False)
        assert done.returncode == 2
        assert done.stdout == ""
        assert all(name in done.stderr for name, *_ in METHODS)


@needs_compiler
@pytest.mark.slow
def test_the_lines_for_the_classes_of_the_assignment(mine, program):
    """They compile with classes of these names, and print what the program prints."""
    source = (mine / "rope.cpp").read_text()
    page = (mine / "README.md").read_text()
    (lines,) = re.findall(r"```cpp\n(.*?)```", page, re.DOTALL)
    classes = source[: source.index("int main(")]
    lines = lines.replace('#include "rope.h"', "").replace("CGL::", "")
    (printed,) = runs_of(compiled(mine, classes + lines, "print"), [], ["64"])
    (usual,) = runs_of(program, ["semi-implicit-euler"], ["64"])
    assert printed.read_text() == usual.read_text()


def changed(source, old, new):
    assert source.count(old) == 1, old
    return source.replace(old, new)


BACK = "(now - m->last_position)"
SWEEP = "        restoreLengths();\n"
# By what the tutorial says: a change of the program, with its method, spec and steps per frame; and
# the largest errors with the diagnosis, or the order.
ANSWERS = {
    "steps: 20, 38, 66 and 106": (
        (BACK, f"{BACK} * (1 - 0.00005)", "verlet-forces", "springs.toml", [256, 512, 1024, 2048]),
        ([20, 38, 66, 106], "damping-per-step"),
    ),
    "The error is 1.8e+02 at each step size.": (
        (
            "        s.m2->forces -= pull;\n",
            "",
            "semi-implicit-euler",
            "springs.toml",
            [32, 64, 128],
        ),
        ([180] * 3, "parameters"),
    ),
    "order 1.01 [0.99, 1.02]": (
        (SWEEP, f"{{{SWEEP}{SWEEP}}}", "verlet-constraints", "rigid.toml", [128, 256, 512, 1024]),
        None,
    ),
}


@needs_compiler
@pytest.mark.slow
@pytest.mark.parametrize("words", ANSWERS)
def test_the_answers_of_the_tutorial(mine, known, words):
    assert words in TUTORIAL.read_text()
    (old, new, method, spec, steps), wrong = ANSWERS[words]
    program = compiled(mine, changed((mine / "rope.cpp").read_text(), old, new), "changed")
    report = grade(runs_of(program, [method], steps), known[spec], expected_order=1)
    order = report.findings[1]
    if wrong is None:
        assert words in order.line
        return
    errors, cause = wrong
    assert order.convergence.quantities["position"].errors == pytest.approx(errors, rel=0.025)
    assert report.verdict == "wrong"
    assert report.diagnosis[0].cause == cause


def without_measurements(text):
    """Without the parts that differ between machines: seconds, and uncertainties by rounding."""
    text = re.sub(r" \(\d+\.\d s\)", "", text)
    return " ".join(re.sub(r"± [\d.e+-]+", "±", text).split())


def changed_by(diff, source):
    lines = diff.splitlines()
    old, new = ("\n".join(line[1:] for line in lines if line[0] in kept) for kept in (" -", " +"))
    return changed(source, old, new)


@needs_compiler
@pytest.mark.slow
def test_the_tutorial(tmp_path):
    """As a reader does: block after block, in an empty folder, with what is printed compared."""
    command = tmp_path / "bin" / "ropeode"
    command.parent.mkdir()
    command.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m ropeode "$@"\n')
    command.chmod(0o755)
    environment = {**os.environ, "PATH": f"{command.parent}:{os.environ['PATH']}"}
    folder, printed = tmp_path / "empty", ""
    folder.mkdir()
    blocks = re.findall(r"^```(\w+)\n(.*?)^```", TUTORIAL.read_text(), re.DOTALL | re.MULTILINE)
    assert {kind for kind, _ in blocks} == {"sh", "text", "diff"}
    for kind, block in blocks:
        if kind == "text":
            assert without_measurements(printed) == without_measurements(block)
        elif kind == "diff":
            source = folder / "rope.cpp"
            source.write_text(changed_by(block, source.read_text()))
        else:
            # In the folder to which the block before it went.
            line = ["bash", "-e", "-c", f"{block}\npwd >&2"]
            done = subprocess.run(
                line, cwd=folder, env=environment, capture_output=True, text=True, check=True
            )
            printed, folder = done.stdout, Path(done.stderr.splitlines()[-1])
