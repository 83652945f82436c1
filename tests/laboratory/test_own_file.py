"""The user's file: each version is seen, the last one that works stays, and none is stale."""

from __future__ import annotations

import asyncio
import os
import sys

import pytest

from ropeode.laboratory import OwnFile, WatchedFile
from tests.time_limit import HANGS_AFTER_S

pytestmark = pytest.mark.anyio

STEP = "def {}(rhs, t, y, dt, args):\n    return y + {} * dt * rhs(t, y, args)\n"
TWO = STEP.format("one", 1) + STEP.format("two", 2)


def test_a_file_has_several_steppers_or_the_one_that_is_named():
    for where, names in (
        ("steps.py", ["steps.py:one", "steps.py:two"]),
        ("steps.py:two", ["steps.py:two"]),
    ):
        own = OwnFile(where)
        loaded = own.load("v", TWO, None)
        assert [(each.name, each.version) for each in loaded.own] == [(n, "v") for n in names]
        assert [each.stepper.label for each in own.own.values()] == names


@pytest.mark.parametrize(
    ("text", "words", "line"),
    [
        (TWO + "def broken(:\n", "SyntaxError: invalid syntax", 5),
        (TWO + "\n1 / 0\n", "ZeroDivisionError: division by zero", 6),
        (TWO + "raise SystemExit(3)\n", "SystemExit: 3", 5),
        ("x = 1\n", "this one has none", None),
        ("\0", "null bytes", None),
    ],
)
def test_a_fault_is_told_with_its_line_and_the_old_stepper_stays(text, words, line):
    own = OwnFile("steps.py")
    own.load("good", TWO, None)
    before = own.own["steps.py:two"].stepper
    loaded = own.load("bad", text, None)
    assert words in loaded.own[0].fault
    assert {each.line for each in loaded.own} == {line}
    assert {each.version for each in loaded.own} == {"good"}
    assert own.own["steps.py:two"].stepper is before
    assert own.load("mended", TWO, None).own[0].fault is None


async def test_what_it_imports_is_run_again_and_watched(tmp_path):
    helper, path = tmp_path / "of_mine.py", tmp_path / "steps.py"
    path.write_text("import numpy\nfrom of_mine import step as other\n" + STEP.format("step", 3))
    helper.write_text("step = 1\n")
    file, own = WatchedFile(path), OwnFile(str(path))
    first = file.newest
    loaded = own.load(first.name, first.text, None)
    assert loaded.files == (str(helper),)
    file.import_from([helper])

    async def change(text):
        helper.write_text(text)
        # In the same second and of the same size, with times that a clumsy tool has set back.
        os.utime(helper, ns=(0, len(text)))
        version = await asyncio.wait_for(file.changed(), 10)
        return version, own.load(version.name, version.text, None)

    second, _ = await change("step = 2\n")
    assert second.name != first.name
    (module,) = (each for name, each in sys.modules.items() if name.endswith(".of_mine"))
    assert module.step == 2
    _, loaded = await change("step = (\n")
    assert (loaded.own[0].version, loaded.own[0].line) == (second.name, 2)
    assert str(helper) in loaded.files


async def test_versions_follow_the_text_and_not_the_time(tmp_path, monkeypatch):
    monkeypatch.setattr("ropeode.laboratory.watch._LOOKS_AGAIN_S", 0.01)
    path = tmp_path / "steps.py"
    path.write_text("1")
    file = WatchedFile(path)
    first = file.newest

    async def changed(contents, within=HANGS_AFTER_S):
        path.unlink(missing_ok=True)
        if contents is not None:
            path.write_bytes(contents)
        return await asyncio.wait_for(file.changed(), within)

    with pytest.raises(TimeoutError):
        await changed(b"1", 0.2)
    assert (await changed(b"2")).text == "2"
    assert "cannot be read" in (await changed(None)).fault
    assert (await changed(b"1")).name == first.name
    assert (await changed(b"# coding: latin-1\nx = '\xe9'\n")).text.endswith("x = 'é'\n")
    assert "cannot be read" in (await changed(b"\xe9")).fault
    # Another run of the lab has other names.
    assert WatchedFile(path).newest.name != file.newest.name
