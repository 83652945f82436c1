"""A rubric: how many points which checks are worth."""

from __future__ import annotations

import fnmatch
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, StrictBool

from ropeode.checking import CHECKS, GRADE_CHECKS
from ropeode.errors import InputError
from ropeode.files import parse_toml, read_text
from ropeode.validation import Input, NonNegative, bad_value, complaint, field, unknown

OF_STEPPERS, OF_FILES = tuple(CHECKS), GRADE_CHECKS
# The default for each collection of checks.
DEFAULTS = {
    OF_STEPPERS: """\
[[item]]
name = "runs"                # it could be checked to the end
points = 2

[[item]]
name = "order"
points = 4
checks = ["order-*"]
partial = true               # the share of the checks that passed

[[item]]
name = "mechanics"           # all of these passed, or no points
points = 2
checks = ["pins", "momentum", "free-flight", "translation", "rotation", "mirror", "boost"]

[[item]]
name = "all checks"
points = 2
checks = ["*"]
""",
    OF_FILES: """\
[[item]]
name = "files"               # they could be graded: read, and begin as the problem does
points = 2

[[item]]
name = "order"
points = 6
checks = ["order"]

[[item]]
name = "all checks"
points = 2
checks = ["*"]
""",
}


def _line_of_text(value: str) -> str:
    if not value.strip():
        raise ValueError("it is empty")
    return value


def _patterns(value: Any) -> Any:
    if value == []:
        raise ValueError("there is none; leave it out where none is needed")
    return value


class Item(Input):
    """One line of a rubric.

    Arguments:
        name: in the feedback.
        points: that it is worth.
        checks: names of checks; none where it is enough that the submission could be checked.
        partial: whether it gives the share of the checks that passed, and not all or nothing.

    Raises:
        InputError: one line for each that cannot be used.
    """

    name: Annotated[str, AfterValidator(_line_of_text)] = field(
        ..., allowed="a text", example='"order"'
    )
    points: NonNegative = field(..., allowed="a number, 0 or more", example="4")
    checks: Annotated[tuple[str, ...], BeforeValidator(_patterns)] = field(
        (), allowed="a list of names of checks", example='["order*", "pins"]'
    )
    partial: StrictBool = field(False, allowed="true or false", example="true")

    def earned(self, findings: Mapping[str, str]) -> float:
        """The points for a submission that was checked to the end.

        Checks that do not apply, or only measure, do not count; if none is left, there are no
        points.

        Arguments:
            findings: the status of each check, by its name.
        """
        if not self.checks:
            return self.points
        counted = [findings[each] for each in self.checks if each in findings]
        counted = [each for each in counted if each in ("pass", "fail", "undetermined")]
        passed = counted.count("pass")
        if self.partial:
            return self.points * passed / len(counted) if counted else 0.0
        return self.points if counted and passed == len(counted) else 0.0


def read_rubric(path: Path | None, checks: tuple[str, ...]) -> tuple[Item, ...]:
    """The items of a rubric in a file; those of the default one without a file.

    Arguments:
        path: of the file.
        checks: names of those that are made, `OF_STEPPERS` or `OF_FILES`.

    Raises:
        InputError: the file cannot be used; one line for each fault, with the field's name.
    """
    text = DEFAULTS[checks] if path is None else read_text("rubric", path)
    given = parse_toml("rubric", str(path), text, "the default rubric in docs/howto/classroom.md")
    faults = [unknown("field of the rubric", name, ["item"]) for name in given if name != "item"]
    items, read = given.get("item", ...), dict[str, Item]()
    if not isinstance(items, list) or not items:
        fix = 'begin with [[item]], name = "order", points = 4, checks = ["order-*"]'
        faults.append(complaint("item", items, "at least one table [[item]]", fix))
        items = []
    for number, each in enumerate(items, 1):
        try:
            if not isinstance(each, dict):
                raise bad_value("table", each, "a table with name and points", "write [[item]]")
            item = Item(**each)
            if item.name in read:
                raise bad_value("name", item.name, "a name of its own", "rename it")
            read[item.name] = item.model_copy(update={"checks": _named(item.checks, checks)})
        except InputError as error:
            faults += [f"item[{number}].{line}" for line in error.problems]
    if faults:
        raise InputError([f"rubric: {fault}" for fault in faults])
    return tuple(read.values())


def _named(patterns: Collection[str], checks: Collection[str]) -> tuple[str, ...]:
    """The names that patterns stand for."""
    nothing = [each for each in patterns if not fnmatch.filter(checks, each)]
    if nothing:
        raise InputError([unknown("checks", each, checks) for each in nothing])
    return tuple(n for n in checks if any(fnmatch.fnmatchcase(n, each) for each in patterns))
