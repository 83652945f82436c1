"""The parts of the room: design knows neither of the others, and these do not know each other."""

import ast
from pathlib import Path

import pytest

import ropeode.sweep

ROOM = Path(ropeode.sweep.__file__).parent
ALLOWED = {
    "design": {"design"},
    "storage": {"design", "storage"},
    "execution": {"design", "execution"},
}


@pytest.mark.parametrize("part", ALLOWED)
def test_parts_import_in_one_direction(part):
    files = sorted((ROOM / part).glob("*.py"))
    assert len(files) > 3
    for file in files:
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("ropeode.sweep"):
                assert node.module.split(".")[2] in ALLOWED[part], f"{file}: {node.module}"
