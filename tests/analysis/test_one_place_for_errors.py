"""Where a candidate is compared with the truth."""

from __future__ import annotations

import ast
from pathlib import Path

import ropeode

PACKAGE = Path(ropeode.__file__).parent
# Errors; and the distance between two runs, neither of which is the truth.
MAY_MEASURE = ("analysis/errors.py", "analysis/roundoff.py", "references/")


def imports_distance(path: Path) -> bool:
    return any(
        isinstance(node, ast.ImportFrom)
        and node.module == "ropeode.norms"
        and any(alias.name == "distance" for alias in node.names)
        for node in ast.walk(ast.parse(path.read_text()))
    )


def test_errors_are_measured_in_one_place():
    measuring = {
        path.relative_to(PACKAGE).as_posix()
        for path in PACKAGE.rglob("*.py")
        if imports_distance(path)
    }
    assert "analysis/errors.py" in measuring
    assert not {name for name in measuring if not name.startswith(MAY_MEASURE)}
