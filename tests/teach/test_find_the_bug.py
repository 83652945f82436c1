"""Each bug of docs/teach/find-the-bug is found, in the words of its answer, and mended by it."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[2] / "docs/teach/find-the-bug"
BUGS = sorted(FOLDER.glob("*.py"))
FENCE = re.compile(r"^```(\w+)\n(.*?)^```", re.MULTILINE | re.DOTALL)
HUNK = re.compile(r"((?:^-.*\n)+)((?:^\+.*\n)+)", re.MULTILINE)


def section(bug: Path) -> str:
    """What the sheet says of it."""
    pages = re.split(r"^## ", (FOLDER / "sheet.md").read_text(), flags=re.MULTILINE)
    (found,) = [each for each in pages if each.startswith(f"Bug {int(bug.stem[3:])}\n")]
    return found


def answer(bug: Path) -> dict[str, str]:
    """The last blocks of code of a section, by their language: `text` and `diff`."""
    return dict(FENCE.findall(section(bug).partition("<summary>Answer")[2]))


def mended(bug: Path) -> str:
    """The text of a file with the change of its answer."""
    text = bug.read_text()
    for hunk in HUNK.findall(answer(bug)["diff"]):
        old, new = (re.sub(r"^[-+]", "", part, flags=re.MULTILINE) for part in hunk)
        assert text.count(old) == 1, f"{old!r} stands {text.count(old)} times in {bug.name}"
        text = text.replace(old, new)
    return text


def words(text: str) -> str:
    """Without line breaks, which depend on what stands beside a sentence."""
    return " ".join(text.split()).replace("- ", "-")


def test_each_bug_has_two_hints_an_answer_and_a_command():
    assert [bug.name for bug in BUGS] == [f"bug{number:02}.py" for number in range(1, 13)]
    for bug in BUGS:
        said = section(bug)
        assert re.findall(r"<summary>(.*)</summary>", said) == ["Hint 1", "Hint 2", "Answer"]
        assert said.count("</details>") == 3
        assert f"[{bug.name}]({bug.name})" in said
        assert f"\nropeode check {bug.name}" in bug.read_text()
        assert mended(bug) != bug.read_text()


@pytest.mark.slow
@pytest.mark.parametrize("bug", BUGS, ids=lambda bug: bug.stem)
def test_check_finds_the_bug_and_passes_what_is_mended(run, tmp_path, bug):
    _, command, name, *claims = shlex.split(bug.read_text().splitlines()[2])
    (tmp_path / name).write_text(bug.read_text())
    found = run(command, name, *claims)
    assert found.returncode == 1
    assert words(answer(bug)["text"]) in words(found.stdout)
    (tmp_path / name).write_text(mended(bug))
    right = run(command, name, *claims)
    assert right.returncode == 0, right.stdout
    assert "\nRight: " in right.stdout
