"""The list of deliberate faults: each is where it should be, and is a program."""

from __future__ import annotations

import ast
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


def test_each_fault_has_its_place(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks"))
    import faults

    for fault in tomllib.loads(faults.FAULTS.read_text())["fault"]:
        path, old, new = faults.place_of(fault, ROOT)
        assert old != new, fault
        # What cannot be parsed is noticed by any test.
        ast.parse(path.read_text().replace(old, new))
        assert faults.test_files(fault["tests"], ROOT), fault
    with pytest.raises(SystemExit, match="occurs 0 times, not once"):
        faults.place_of({"file": "norms.py", "old": "no such text", "new": ""}, ROOT)
