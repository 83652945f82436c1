"""The rooms of the package and which imports which, drawn from their import statements.

`make docs` puts what `picture` returns into CONTRIBUTING.md; `python docs/rooms.py` prints it.
"""

from __future__ import annotations

import ast
import graphlib
from pathlib import Path

PACKAGE = Path(__file__).parents[1] / "ropeode"

# A room and the rooms that it imports.
Imports = dict[str, set[str]]


def imports() -> Imports:
    """Of each folder and each file of the package, which others it imports anywhere in it."""
    rooms: Imports = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        room = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
        if room.startswith("__"):
            continue
        others = rooms.setdefault(room, set())
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                modules = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                modules = [f"{node.module}.{alias.name}" for alias in node.names]
            else:
                continue
            others |= {name.split(".")[1] for name in modules if name.startswith("ropeode.")}
        others.discard(room)
    # Public names that users' templates import from the package itself are no rooms.
    return {room: others & rooms.keys() for room, others in rooms.items()}


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
