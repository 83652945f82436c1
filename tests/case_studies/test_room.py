"""The room can be lifted out: all that belongs to the published report is in it."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import ropeode

PACKAGE = Path(ropeode.__file__).parent
ROOM = PACKAGE / "case_studies"
# What adds its command, what lists public names, and the lab, which shows its figures as scenes.
MAY_IMPORT = {
    Path("cli/main.py"),
    Path("__init__.py"),
    Path("__init__.pyi"),
    Path("laboratory/scenes/__init__.py"),
    Path("laboratory/scenes/make_verdicts.py"),
}


def outside():
    files = [path for path in PACKAGE.rglob("*.py*") if path.suffix in (".py", ".pyi")]
    return [path for path in files if ROOM not in path.parents]


def test_nothing_else_imports_it():
    importing = {
        path.relative_to(PACKAGE)
        for path in outside()
        if any(line_imports(node) for node in ast.walk(ast.parse(path.read_text())))
        or "case_studies." in path.read_text()
    }
    assert importing <= MAY_IMPORT
    assert Path("cli/main.py") in importing


def line_imports(node):
    if isinstance(node, ast.ImportFrom):
        return (node.module or "").startswith("ropeode.case_studies")
    return isinstance(node, ast.Import) and any(
        alias.name.startswith("ropeode.case_studies") for alias in node.names
    )


def test_the_command_is_added_in_one_line():
    main = (PACKAGE / "cli" / "main.py").read_text()
    assert len(re.findall("case_studies", main)) == 1


def test_nothing_of_the_report_is_elsewhere():
    """Nothing outside speaks of its figures, its claims or its formats."""
    words = re.compile(r"rope_report|format_report|draw_report|ropeode\.report|figures\.toml")
    speaking = {path.relative_to(PACKAGE) for path in outside() if words.search(path.read_text())}
    assert speaking <= MAY_IMPORT
