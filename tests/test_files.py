"""Files are written whole or not at all."""

from __future__ import annotations

import fcntl
import os
import stat

import pytest

from ropeode.errors import InputError
from ropeode.files import check_writable, parse_toml, write_whole


def test_writes_and_replaces(tmp_path):
    path = tmp_path / "table.txt"
    for text in ("first", "second ✓", b"\x89PNG\r\n\x1a\n"):
        write_whole(path, text)
        assert path.read_bytes() == (text if isinstance(text, bytes) else text.encode())
    assert os.listdir(tmp_path) == ["table.txt"]
    mask = os.umask(0)
    os.umask(mask)
    assert stat.S_IMODE(path.stat().st_mode) == 0o666 & ~mask


def test_no_room_leaves_the_old_file(tmp_path, room_for):
    path = tmp_path / "table.txt"
    write_whole(path, "old")
    with room_for(1000), pytest.raises(InputError, match=r"out: .* \(File too large\)"):
        write_whole(path, "new" * 1000)
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["table.txt"]


def test_links_pipes_and_devices_stay_what_they_are(tmp_path):
    (tmp_path / "old").write_text("old")
    (tmp_path / "link").symlink_to("old")
    write_whole(tmp_path / "link", "new")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "old").read_text() == "new"
    os.mkfifo(tmp_path / "pipe")
    reader = os.open(tmp_path / "pipe", os.O_RDONLY | os.O_NONBLOCK)
    write_whole(check_writable("out", tmp_path / "pipe"), "text")
    assert os.read(reader, 10) == b"text"
    os.close(reader)
    assert stat.S_ISFIFO((tmp_path / "pipe").stat().st_mode)
    assert sorted(os.listdir(tmp_path)) == ["link", "old", "pipe"]


def test_parts_that_killed_processes_left_are_removed(tmp_path):
    path = tmp_path / "table.txt"
    for name in (".table.txt.abcdefgh.part", ".other.nc.01234567.part", ".mine.part", "x.part"):
        (tmp_path / name).write_text("half")
    with (tmp_path / ".table.txt.in_use_9.part").open("wb") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        write_whole(path, "whole")
    left = {".mine.part", ".table.txt.in_use_9.part", "table.txt", "x.part"}
    assert set(os.listdir(tmp_path)) == left


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("a = " + "[" * 17, "more than 16 deep .at line 1."),
        ("x = 1\na = " + "{a = " * 5000, "more than 16 deep .at line 2."),
        ("a" + ".a" * 16 + " = 1", "a key of more than 16 parts"),
        ('"=".' * 20 + "a = 1", "a key of more than 16 parts"),
        ("[" + "a . " * 20 + "a]", "a key of more than 16 parts"),
        ("a = " + "9" * 5000, "a key or number of 5000 characters"),
        ("a" * 101 + " = 1", "a key or number of 101 characters"),
        ("#" * (2**20 + 1), "at most 1048576 characters"),
        ("a = ]", "Invalid value"),
    ],
)
def test_toml_that_would_take_memory_or_stack(text, why):
    with pytest.raises(InputError, match=rf"spec: 'x.toml' given; allowed: a TOML file .*{why}"):
        parse_toml("spec", "x.toml", text, "another")


def test_texts_and_comments_in_toml_may_hold_anything():
    many = "[" * 40 + "a." * 40 + "9" * 400
    text = f"""
        # {many}
        a = "{many}"  # "{many}
        b = \"\"\"

{many}\\""\\\\\"\"\"
        c = '''{many}'''''
        ["e.f".g]
        h = "\\""
    """
    values = {"a": many, "b": f'\n{many}""\\', "c": f"{many}''", "e.f": {"g": {"h": '"'}}}
    assert parse_toml("spec", "x.toml", text, "another") == values


def test_targets_are_checked(tmp_path):
    assert check_writable("out", tmp_path / "a.txt") == tmp_path / "a.txt"
    for path, why in ((tmp_path / "missing/a.txt", "folder that exists"), (tmp_path, "a folder")):
        with pytest.raises(InputError, match=f"out: .* {why}"):
            check_writable("out", path)
