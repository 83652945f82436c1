"""A rubric: how many points which checks are worth."""

from __future__ import annotations

import fnmatch
import tomllib
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from ropeode.checking.checks import CHECKS
from ropeode.checking.grade import CHECKS as OF_FILES
from ropeode.errors import InputError
from ropeode.files import read_text
from ropeode.validation import bad_value, finite_number, shown, unknown

OF_STEPPERS = tuple(CHECKS)
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

_FIELDS = ("name", "points", "checks", "partial")


class Item(NamedTuple):
    """One line of a rubric.

    Fields:
        name: in the feedback.
        points: that it is worth.
        checks: names of checks; none where it is enough that the submission could be checked.
        partial: whether it gives the share of the checks that passed, and not all or nothing.
    """

    name: str
    points: float
    checks: tuple[str, ...] = ()
    partial: bool = False

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
    try:
        given = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        fix = "see the default rubric in docs/howto/classroom.md"
        raise bad_value("rubric", str(path), f"a TOML file ({error})", fix) from error
    faults = [unknown("field of the rubric", name, ["item"]) for name in given if name != "item"]
    items = given.get("item")
    if not isinstance(items, list) or not items:
        fix = 'begin with [[item]], name = "order", points = 4, checks = ["order-*"]'
        faults.append(_fault("item", items, "at least one table [[item]]", fix))
        raise InputError(faults)
    read = [_item(f"item[{number}]", each, checks, faults) for number, each in enumerate(items, 1)]
    names = [each.name for each in read]
    for number, name in enumerate(names, 1):
        if name in names[: number - 1]:
            faults.append(_fault(f"item[{number}].name", name, "a name of its own", "rename it"))
    if faults:
        raise InputError(faults)
    return tuple(read)


def _item(where: str, given: Any, checks: Collection[str], faults: list[str]) -> Item:
    """One item; its faults are added to the others."""
    if not isinstance(given, dict):
        faults.append(_fault(where, given, "a table with name and points", "write [[item]]"))
        return Item(where, 0.0)
    faults += [unknown(f"field of {where}", name, _FIELDS) for name in given if name not in _FIELDS]
    name = given.get("name")
    if not isinstance(name, str) or not name.strip():
        faults.append(_fault(f"{where}.name", name, "a text", 'for example name = "order"'))
        name = where
    points, number = given.get("points"), 0.0
    try:
        number = finite_number(points)
        if number < 0.0:
            raise ValueError("negative")
    except ValueError:
        fix = "for example points = 4"
        faults.append(_fault(f"{where}.points", points, "a number, 0 or more", fix))
    partial = given.get("partial", False)
    if not isinstance(partial, bool):
        faults.append(_fault(f"{where}.partial", partial, "true or false", "partial = true"))
    chosen = _checks(where, given.get("checks"), checks, faults)
    return Item(name, number, chosen, partial is True)


def _checks(where: str, given: Any, checks: Collection[str], faults: list[str]) -> tuple[str, ...]:
    """The names that patterns stand for."""
    if given is None:
        return ()
    if not isinstance(given, list) or not given or not all(isinstance(each, str) for each in given):
        fix = 'for example checks = ["order*", "pins"]; leave it out where none is needed'
        faults.append(_fault(f"{where}.checks", given, "a list of names of checks", fix))
        return ()
    for each in given:
        if not fnmatch.filter(checks, each):
            faults.append(unknown(f"check in {where}.checks", each, checks))
    return tuple(name for name in checks if any(fnmatch.fnmatchcase(name, each) for each in given))


def _fault(name: str, given: Any, allowed: str, fix: str) -> str:
    words = "nothing" if given is None else shown(given)
    return f"rubric: {name}: {words} given; allowed: {allowed}. Fix: {fix}."
