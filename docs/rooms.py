"""The rooms of the package and which imports which, drawn from their import statements.

`make docs` puts what `picture` returns into CONTRIBUTING.md; `python docs/rooms.py` prints it.
"""

from __future__ import annotations

import ast
import functools
import graphlib
from collections.abc import Iterator, Mapping, Set
from pathlib import Path

PACKAGE = Path(__file__).parents[1] / "ropeode"

# A module or a room, and those that it imports.
Imports = dict[str, set[str]]


@functools.cache
def trees() -> dict[str, ast.Module]:
    """The syntax tree of each module of the package, by its name."""
    return {_name_of(path): ast.parse(path.read_text()) for path in sorted(PACKAGE.rglob("*.py"))}


def _name_of(path: Path) -> str:
    parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def module_imports(trees: Mapping[str, ast.Module]) -> Imports:
    """Of each module, which others it imports, inside functions too."""
    return {
        module: _imports_in(tree, trees.keys()) - {module}
        for module, tree in trees.items()
        # What `ropeode check --template` prints imports the package as a user does.
        if not module.startswith("ropeode.steppers.templates.")
    }


def _imports_in(tree: ast.AST, names: Set[str]) -> set[str]:
    modules = set()
    for statement in _statements_in(tree):
        if isinstance(statement, ast.Import):
            modules |= {alias.name for alias in statement.names}
        elif isinstance(statement, ast.ImportFrom):
            assert statement.level == 0, "a relative import"
            inner = {f"{statement.module}.{alias.name}" for alias in statement.names}
            modules |= inner & names or {statement.module or ""}
    return modules & names


def _statements_in(node: ast.AST) -> Iterator[ast.stmt]:
    """Those that run, of functions too."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, (ast.stmt, ast.excepthandler, ast.match_case)):
            if isinstance(child, ast.stmt):
                yield child
            if not _is_for_types(child):
                yield from _statements_in(child)


def _is_for_types(node: ast.AST) -> bool:
    """`if TYPE_CHECKING:`, whose imports never run."""
    return (
        isinstance(node, ast.If)
        and isinstance(node.test, ast.Name)
        and node.test.id == "TYPE_CHECKING"
    )


def room_of(module: str) -> str:
    """The folder or file of the package that a module is in; `__init__` for the package."""
    return (*module.split("."), "__init__")[1]


def imports() -> Imports:
    """Of each folder and each file of the package, which others it imports anywhere in it."""
    rooms: Imports = {}
    for module, others in module_imports(trees()).items():
        rooms.setdefault(room_of(module), set()).update(map(room_of, others))
    inside = {room for room in rooms if not room.startswith("__")}
    return {room: (rooms[room] & inside) - {room} for room in inside}


def ground_floor(rooms: Imports) -> set[str]:
    """The files that import nothing but each other."""
    ground = {room for room in rooms if not (PACKAGE / room).is_dir()}
    while above := {room for room in ground if not rooms[room] <= ground}:
        ground -= above
    return ground


def upwards(rooms: Imports) -> list[str]:
    """The rooms in an order in which each comes after all that it imports."""
    in_order = {room: sorted(others) for room, others in sorted(rooms.items())}
    return [*graphlib.TopologicalSorter(in_order).static_order()]


def reduced(rooms: Imports) -> Imports:
    """Only those imports that no way over other rooms replaces."""
    below: Imports = {}
    for room in upwards(rooms):
        below[room] = rooms[room].union(*(below[other] for other in rooms[room]))
    return {
        room: {other for other in others if not any(other in below[each] for each in others)}
        for room, others in rooms.items()
    }


def drawn(rooms: Imports) -> list[str]:
    """Lines as `git log --graph` draws them: what imports stands above what is imported.

    Arguments:
        rooms: reduced, without circles.
    """
    lines: list[str] = []
    rails: list[str | None] = []  # In each column the room that a line leads to.

    def connect(columns: list[int], corner: str) -> None:
        first, last = columns[0], columns[-1]
        line = ""
        for column, goal in enumerate(rails):
            inside = first < column < last
            if column == first:
                mark = "├" if last > first else "│"
            elif column in columns:
                mark = corner if column == last else {"╯": "┴", "╮": "┬"}[corner]
            else:
                mark = " ─"[inside] if goal is None else "│┼"[inside]
            line += mark + " ─"[first <= column < last]
        lines.append(line.rstrip())

    for room in reversed(upwards(rooms)):
        columns = [column for column, goal in enumerate(rails) if goal == room]
        if not columns:
            rails.append(room)
            columns = [len(rails) - 1]
        if len(columns) > 1:
            connect(columns, "╯")
        first = columns[0]
        for column in columns[1:]:
            rails[column] = None
        marks = [
            "●" if c == first else " " if goal is None else "│" for c, goal in enumerate(rails)
        ]
        lines.append(f"{' '.join(marks).rstrip()} {room}")
        rails[first], *rest = sorted(rooms[room]) or [None]
        new = []
        for goal in rest:
            free = [c for c in range(first + 1, len(rails)) if rails[c] is None]
            column = free[0] if free else len(rails)
            rails[column : column + 1] = [goal]
            new.append(column)
        if new:
            connect([first, *sorted(new)], "╮")
        while rails and rails[-1] is None:
            rails.pop()
    return lines


def first_sentence(room: str) -> str:
    """What a room is, as its docstring begins."""
    folder = PACKAGE / room / "__init__.py"
    source = folder if folder.exists() else PACKAGE / f"{room}.py"
    docstring = ast.get_docstring(ast.parse(source.read_text())) or ""
    return " ".join(docstring.split()).partition(". ")[0].rstrip(".")


def picture() -> str:
    """The rooms, each above all that it imports, and the ground floor, as Markdown."""
    rooms = imports()
    ground = ground_floor(rooms)
    upper = {room: others - ground for room, others in rooms.items() if room not in ground}
    lines = [*drawn(reduced(upper)), "", *(f"  {room}" for room in sorted(ground))]
    width = max(map(len, lines)) + 2
    described = [
        f"{line:{width}}{first_sentence(line.split()[-1])}" if line[-1:].isalpha() else line
        for line in lines
    ]
    return "\n".join(["```text", *described, "```"])


if __name__ == "__main__":
    print(picture())  # noqa: T201
