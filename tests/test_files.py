"""Files are written whole or not at all."""

from __future__ import annotations

import os
import stat

import pytest

from ropeode.errors import InputError
from ropeode.files import check_writable, read_text, write_whole


def test_writes_and_replaces(tmp_path):
    path = tmp_path / "table.txt"
    for text in ("first", "second ✓"):
        write_whole(path, text)
        assert path.read_text(encoding="utf-8") == text
    assert os.listdir(tmp_path) == ["table.txt"]
    mask = os.umask(0)
    os.umask(mask)
    assert stat.S_IMODE(path.stat().st_mode) == 0o666 & ~mask


def test_writes_bytes(tmp_path):
    write_whole(tmp_path / "picture.png", b"\x89PNG\r\n\x1a\n")
    assert (tmp_path / "picture.png").read_bytes() == b"\x89PNG\r\n\x1a\n"


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


def test_targets_are_checked(tmp_path):
    assert check_writable("out", tmp_path / "a.txt") == tmp_path / "a.txt"
    with pytest.raises(InputError, match="out: .* folder that exists"):
        check_writable("out", tmp_path / "missing" / "a.txt")
    with pytest.raises(InputError, match="out: .* this is a folder"):
        check_writable("out", tmp_path)


def test_unreadable(tmp_path):
    with pytest.raises(InputError, match=r"spec: .* \(No such file"):
        read_text("spec", tmp_path / "missing")
    (tmp_path / "binary").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="not UTF-8"):
        read_text("spec", tmp_path / "binary")
    with pytest.raises(InputError, match="spec: "):
        read_text("spec", tmp_path)
