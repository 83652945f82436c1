"""What counts as a submission of a folder."""

from __future__ import annotations

import os

import pytest

from ropeode.classroom import stepper_submissions, trajectory_submissions
from ropeode.errors import InputError
from tests.classroom.conftest import write


@pytest.fixture
def folder(tmp_path):
    names = ["bert/mine.py", "carla/a.py", "carla/b.py", "dora/readme.txt", "_solution.py"]
    write(tmp_path, dict.fromkeys([*names, ".hidden/x.py", "notes.txt"], ""))
    write(tmp_path, {"anna.py": "def step(): ...\n"})
    return tmp_path


def by_name(folder, name=None, without=None):
    return {each.name: each for each in stepper_submissions(folder, name, without)}


def test_a_file_or_a_subfolder_with_one_file(folder):
    found = by_name(folder)
    assert list(found) == ["anna", "bert", "carla", "dora"]
    assert [found[name].where for name in found] == [("anna.py",), ("bert/mine.py",), (), ()]
    assert "a.py, b.py" in found["carla"].trouble
    assert "no Python file" in found["dora"].trouble
    # The grade book may lie among them.
    assert list(by_name(folder, without=folder / "dora")) == ["anna", "bert", "carla"]
    # A file and a folder of one name have two.
    write(folder, {"anna/step.py": ""})
    found = by_name(folder)
    assert (found["anna"].where, found["anna.py"].where) == (("anna/step.py",), ("anna.py",))


def test_a_name_says_which_function_and_which_file(folder):
    assert by_name(folder, "verlet")["bert"].where == ("bert/mine.py:verlet",)
    found = by_name(folder, "b.py:verlet")
    assert found["carla"].where == ("carla/b.py:verlet",)
    assert found["anna"].where == ("anna.py:verlet",)
    assert "no file b.py" in found["bert"].trouble
    for name in ("b.py", "verlet()", "b.txt:verlet", ""):
        with pytest.raises(InputError, match="name:"):
            stepper_submissions(folder, name)


def test_what_cannot_be_read_has_a_row_and_is_not_waited_for(folder):
    os.mkfifo(folder / "pipe.py")
    for name, to in (("broken", "nowhere.py"), ("loop", "loop.py"), ("endless", "/dev/zero")):
        (folder / f"{name}.py").symlink_to(to)
    (folder / "folder.py").mkdir()
    found = by_name(folder, without=folder / "dora")
    for name in ("pipe", "broken", "loop", "endless", "folder.py"):
        assert (found[name].where, bool(found[name].trouble)) == ((), True)
    assert "broken.py cannot be read (No such file" in found["broken"].trouble


def test_a_name_that_is_not_utf_8_can_be_written(folder):
    for name in (b"m\xfcller.py", b"m\xf6ller.py", b"a\x1b[31m\nb.py"):
        open(os.fsencode(folder) + b"/" + name, "w").close()
    found = by_name(folder)
    names = {"m\\udcfcller", "m\\udcf6ller", "a\\x1b[31m\\nb"}
    assert names < set(found)
    assert all((folder / found[name].where[0]).exists() for name in names)


def test_the_digest_is_that_of_all_files_of_a_submission(folder):
    before = {(name, each.digest) for name, each in by_name(folder).items()}
    write(folder, {"carla/b.py": "x = 1\n"})
    after = {(name, each.digest) for name, each in by_name(folder).items()}
    assert {name for name, _ in before ^ after} == {"carla"}


# Of texts that nobody can read to the end, either.
MARKS = {
    "from ropeode import Stepper\n": (),
    "from ropeode import Stepper, as_stepper\n": ("imports as_stepper of ropeode",),
    "def f():\n    import ropeode.steppers\n": ("imports ropeode.steppers of ropeode",),
    "#" * 2_000_000 + "\n": ("anna.py is too long to be looked through",),
    **dict.fromkeys(("import ropeodes, numpy\n", "def\n", "x = '\0'\n"), ()),
    "x = " + "-" * 200_000 + "1\n": (),
    "x = " + "(" * 100_000 + "1\n": (),
    "x = a" + ".a" * 200_000 + "\n": (),
}


def test_what_is_taken_from_ropeode_is_marked(folder):
    for text, marks in MARKS.items():
        (folder / "anna.py").write_text(text)
        assert by_name(folder)["anna"].marks == marks, text[:40]


def test_a_subfolder_of_trajectories(tmp_path):
    names = ["anna/32.csv", "anna/64.CSV", "anna/data/16.npz"]
    others = ["anna/__MACOSX/32.csv", "anna/.cache/8.nc", "anna/rope.cpp"]
    beside = ["bert/notes.txt", "_solution/32.csv", "loose.csv"]
    write(tmp_path, {name: name for name in (*names, *others, *beside)})
    anna, bert = trajectory_submissions(tmp_path)
    assert (anna.name, anna.where) == ("anna", (*names,))
    assert (bert.name, bert.where) == ("bert", ())
    assert "no file in the folder bert that ends in .csv, .npz, .nc" in bert.trouble
    assert trajectory_submissions(tmp_path, tmp_path / "anna") == [bert]
    # Only they are in the digest.
    write(tmp_path, {others[-1]: "mended"})
    assert trajectory_submissions(tmp_path)[0].digest == anna.digest
    write(tmp_path, {names[-1]: "computed again"})
    assert trajectory_submissions(tmp_path)[0].digest != anna.digest


def test_a_folder_without_submissions(tmp_path):
    write(tmp_path, {"notes.txt": ""})
    with pytest.raises(InputError, match="has none"):
        stepper_submissions(tmp_path)
    with pytest.raises(InputError, match=r"as in `ropeode grade mine/\*.csv`"):
        trajectory_submissions(tmp_path)
