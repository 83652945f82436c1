"""Runge-Kutta methods of users: tableaus in TOML files."""

from __future__ import annotations

import dataclasses
import functools
import math
import re
import warnings
from collections.abc import Mapping
from fractions import Fraction
from pathlib import Path
from typing import Any

from ropeode.errors import InputError, InputWarning
from ropeode.files import parse_toml, read_text
from ropeode.steppers.registry import STEPPERS
from ropeode.steppers.runge_kutta import RungeKutta
from ropeode.tableaus.stages import Number, Row, number, same
from ropeode.tableaus.tableau import Tableau
from ropeode.validation import bad_value, check_whole, complaint, unknown

# What the text of such a stepper begins with.
PREFIX = "runge-kutta"
# Sums over trees of more stages take long, and other texts may be numbers of millions of digits.
_MOST_STAGES, _LONGEST, _HUGE = 256, 100, re.compile(r"[eE][+-]?[\d_]{4,}")
_KEYS = ("A", "b", "c", "name", "order")
_EXAMPLE = 'for Heun\'s method A = [[], [1]], b = ["1/2", "1/2"]'


@dataclasses.dataclass(frozen=True)
class OwnTableau(RungeKutta):
    """A user's explicit Runge-Kutta method.

    Arguments:
        tableau: explicit.
        tableau_order: that its order conditions say.
        name: what tables and plots call it.
    """

    tableau: Tableau  # type: ignore[misc]
    tableau_order: int  # type: ignore[misc]
    name: str  # type: ignore[misc]

    def __post_init__(self) -> None:
        # These are no options: whoever reads the file has checked them, and an order may be 0.
        pass

    @property
    def label(self) -> str:
        """The name."""
        return self.name


def is_tableau_file(text: str) -> bool:
    """Whether a stepper's text names a file with a tableau."""
    return text.partition(":")[0] == PREFIX


def file_of(text: str) -> str:
    """The name of the file in a stepper's text, ``runge-kutta:FILE.toml``.

    Raises:
        InputError: there is none.
    """
    file = text.partition(":")[2]
    if not file.endswith(".toml"):
        fix = "write the tableau into a file; docs/howto/steppers.md shows one"
        raise bad_value("stepper", text, f"{PREFIX}:FILE.toml", fix)
    return file


def tableau_stepper(text: str, folder: Path) -> OwnTableau:
    """The stepper of a file, which has keys A, b, and maybe c, name and order.

    Its order is that of the order conditions. A sum of weights that is not 1, and times c that are
    not the row sums of A, cost order, and cause an `InputWarning`.

    Arguments:
        text: ``runge-kutta:FILE.toml``.
        folder: that a relative file name starts from.

    Raises:
        InputError: the file cannot be used; one line for each fault.
    """
    path = folder / file_of(text)
    stepper, doubts = _from_text(text, str(path), read_text("stepper", path))
    for doubt in doubts:
        warnings.warn(doubt, InputWarning, stacklevel=4)
    return stepper


# The order conditions of a method of order 8 take a second.
@functools.lru_cache(maxsize=64)
def _from_text(text: str, path: str, contents: str) -> tuple[OwnTableau, tuple[str, ...]]:
    """The stepper, and what is doubtful about it."""
    given = parse_toml("stepper", path, contents, "docs/howto/steppers.md for one")
    tableau, faults = _tableau(given)
    faults += [unknown("key", key, _KEYS) for key in given if key not in _KEYS]
    name = given.get("name", text)
    if not isinstance(name, str) or not name.isprintable() or not name.strip() or _is_taken(name):
        allowed = "a line of text that is not the name of a stepper of ropeode"
        faults.append(complaint("name", name, allowed, 'for example name = "my method"'))
    claimed = 0
    if "order" in given:
        try:
            claimed = check_whole("order", given["order"], at_least=1, example="4")
        except InputError as error:
            faults += error.problems
    if tableau is not None and claimed > tableau.order:
        faults.append(_too_high(claimed, tableau))
    if tableau is None or faults:
        # Several files may be given.
        raise InputError([f"{path}: {fault}" for fault in faults])
    return OwnTableau(tableau, tableau.order, name), tuple(_doubts(path, tableau))


def _tableau(given: Mapping[str, Any]) -> tuple[Tableau | None, list[str]]:
    """The tableau that is given; None and the faults where there are any."""
    faults: list[str] = []
    b = _row("b", given.get("b", ...), faults)
    rows = given.get("A", ...)
    if not isinstance(rows, list) or not all(isinstance(row, list) for row in rows):
        faults.append(complaint("A", rows, "a list of rows, each a list", _EXAMPLE))
    if faults:
        return None, faults
    a = [_row(f"A[{i}]", row, faults) for i, row in enumerate(rows, 1)]  # type: ignore[arg-type]
    c = _row("c", given["c"], faults) if "c" in given else None
    stages = len(b)
    if stages > _MOST_STAGES:
        faults.append(_of_length("b", f"{stages} weights", _MOST_STAGES, "weights or fewer"))
    if len(a) != stages:
        faults.append(_of_length("A", f"{len(a)} rows", stages, "rows, one for each weight b"))
    if c and len(c) != stages:
        faults.append(_of_length("c", f"{len(c)} times", stages, "times, one for each weight b"))
    for i, row in enumerate(a):
        if row and len(row) not in (i, stages):
            allowed = f"{i} of them, or {stages} with the zeros"
            fix = f"write as many as there are slopes before k{i + 1}"
            faults.append(complaint(f"A[{i + 1}]", f"{len(row)} entries", allowed, fix))
            continue
        for j, entry in enumerate(row[i:], i):
            if entry:
                allowed = (
                    "0 there, in explicit methods: the slope "
                    f"k{i + 1} would depend on k{j + 1}; implicit tableaus are not taken"
                )
                fix = "take an implicit stepper, or a solver such as diffrax:Kvaerno3"
                faults.append(complaint(f"A[{i + 1}][{j + 1}]", _plain(entry), allowed, fix))
                break
    return (None, faults) if faults else (Tableau.of(a, b, c), [])


def _of_length(name: str, given: str, wanted: int, what: str) -> str:
    return complaint(name, given, f"{wanted} {what}", "add or drop some")


def _row(name: str, given: Any, faults: list[str]) -> Row:
    """Numbers; faults are added to the others."""
    if not isinstance(given, list) or (not given and name in ("b", "c")):
        faults.append(complaint(name, given, "a list of numbers", _EXAMPLE))
        return ()
    row = []
    for i, entry in enumerate(given, 1):
        value = _number(entry)
        if value is None:
            allowed = 'finite numbers, and fractions as texts such as "1/3"'
            faults.append(complaint(f"{name}[{i}]", entry, allowed, 'write 0.25, or "1/4"'))
        else:
            row.append(value)
    return tuple(row)


def _number(entry: Any) -> Number | None:
    """An entry of a file; None where it is no number."""
    if isinstance(entry, bool) or not isinstance(entry, int | float | str):
        return None
    if isinstance(entry, str) and (len(entry) > _LONGEST or _HUGE.search(entry)):
        return None
    try:
        value = number(entry)
        return value if math.isfinite(value) else None
    except (ValueError, ZeroDivisionError, OverflowError):
        return None


def _is_taken(name: str) -> bool:
    """Whether a stepper of ropeode, or one of its forms with options, has this name."""
    return name.partition(":")[0] in STEPPERS


def _too_high(claimed: int, tableau: Tableau) -> str:
    """The complaint about an order that is higher than that of the conditions."""
    found = tableau.order
    unmet = next(each for each in tableau.errors(found + 1) if not each.met)
    condition, _, exact = tableau.condition(unmet.tree).rpartition(" = ")
    allowed = (
        f"at most {found}; of the conditions for order {found + 1} one is {condition} = {exact}, "
        f"and here it is {_plain(unmet.weight)}"
    )
    return complaint("order", claimed, allowed, "look for a mistyped coefficient, or claim less")


def _doubts(path: str, tableau: Tableau) -> list[str]:
    """What consistent methods do not have, in a line each."""
    doubts = []
    total = sum(tableau.b, Fraction(0))
    if not same(total, Fraction(1)):
        doubts.append(
            f"{path}: the weights b add up to {_plain(total)}, not to 1; its order is "
            f"{tableau.order}: it converges to the solution of another equation."
        )
    for i, (time, added) in enumerate(zip(tableau.c, tableau.row_sums, strict=True), 1):
        if not same(time, added):
            order, without_time = tableau.order, tableau.order_without_time
            rest = f", and {without_time} where the right-hand side does not depend on time"
            doubts.append(
                f"{path}: c[{i}] is {_plain(time)}, and row {i} of A adds up to {_plain(added)}; "
                f"its order is {order}{rest if without_time > order else ''}."
            )
            break
    return doubts


def _plain(value: Number) -> str:
    return str(value) if isinstance(value, Fraction) else f"{value:.15g}"
