"""Each bug of docs/teach/find-the-bug is found, in the words of its answer, and mended by it."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import numpy as np
import pytest

from ropeode.checking import Examination, generic
from ropeode.precision import in_float64
from ropeode.steppers import as_stepper
from tests.checking.mutants.all import MUTANTS

FOLDER = Path(__file__).parents[2] / "docs/teach/find-the-bug"
# What each was made from.
MADE_FROM = {
    1: "own_euler: other end pulled the same way",
    2: "own_euler: missing mass",
    3: "own_verlet: written over its input",
    4: "own_euler: missing force reset",
    5: "velocity_verlet: half missing",
    6: "velocity_verlet: lagged damping",
    7: "semi_implicit_euler: damping per step",
    8: "StormerVerlet: starts from rest",
    9: "heun: second stage at t",
    10: "rk4: third stage from the first",
    11: "own_euler: positions updated node by node, forces computed between",
    12: "velocity_verlet: longest step 1/60",
}
DT = 0.03
FENCE = re.compile(r"^```(\w+)\n(.*?)^```", re.MULTILINE | re.DOTALL)
HUNK = re.compile(r"((?:^-.*\n)+)((?:^\+.*\n)+)", re.MULTILINE)


def section(number: int) -> str:
    """What the sheet says of a bug."""
    pages = re.split(r"^## ", (FOLDER / "sheet.md").read_text(), flags=re.MULTILINE)
    (found,) = [each for each in pages if each.startswith(f"Bug {number}\n")]
    return found


def answer(number: int) -> dict[str, str]:
    """The last blocks of code of a section, by their language: `text` and `diff`."""
    return dict(FENCE.findall(section(number).partition("<summary>Answer")[2]))


def file_of(number: int) -> Path:
    return FOLDER / f"bug{number:02}.py"


def mended(number: int) -> str:
    """The text of a file with the change of its answer."""
    text = file_of(number).read_text()
    for hunk in HUNK.findall(answer(number)["diff"]):
        old, new = (re.sub(r"^[-+]", "", part, flags=re.MULTILINE) for part in hunk)
        assert text.count(old) == 1, f"{old!r} stands {text.count(old)} times in bug {number}"
        text = text.replace(old, new)
    return text


def words(text: str) -> str:
    """Without line breaks, which depend on what stands beside a sentence."""
    return " ".join(text.split()).replace("- ", "-")


@pytest.mark.parametrize("number", MADE_FROM)
def test_a_bug_has_two_hints_an_answer_and_a_command(number):
    said = section(number)
    assert re.findall(r"<summary>(.*)</summary>", said) == ["Hint 1", "Hint 2", "Answer"]
    assert said.count("</details>") == 3
    assert f"[bug{number:02}.py](bug{number:02}.py)" in said
    assert f"\nropeode check bug{number:02}.py" in file_of(number).read_text()
    assert mended(number) != file_of(number).read_text()


def test_there_are_twelve():
    assert sorted(FOLDER.glob("*.py")) == [file_of(number) for number in MADE_FROM]


@in_float64
def one_step(stepper):
    return Examination(stepper).one_step(generic(), DT)


def called_once(stepper):
    """What a function returns without being tried before."""
    return np.stack(
        getattr(stepper, "function", stepper)(None, 0.0, *generic().y0, DT, generic().args)
    )


@pytest.mark.slow
@pytest.mark.parametrize("number", MADE_FROM)
def test_a_bug_behaves_as_the_mutant_that_it_was_made_from(number):
    """As no runs can be made with hidden state, that of bug 4 is called once."""
    bug, mutant = as_stepper(str(file_of(number))), MUTANTS[MADE_FROM[number]].make()
    call = called_once if number == 4 else one_step
    assert np.allclose(call(bug), call(mutant), rtol=1e-13, atol=1e-13)


@pytest.mark.slow
@pytest.mark.parametrize("number", MADE_FROM)
def test_check_finds_the_bug_and_passes_what_is_mended(run, tmp_path, number):
    _, command, name, *claims = shlex.split(file_of(number).read_text().splitlines()[2])
    (tmp_path / name).write_text(file_of(number).read_text())
    found = run(command, name, *claims)
    assert found.returncode == 1
    assert words(answer(number)["text"]) in words(found.stdout)
    (tmp_path / name).write_text(mended(number))
    right = run(command, name, *claims)
    assert right.returncode == 0, right.stdout
    assert "\nRight: " in right.stdout
