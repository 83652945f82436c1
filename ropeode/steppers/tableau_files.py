"""Runge-Kutta methods of users: tableaus in TOML files."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import math
import re
import warnings
from fractions import Fraction
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, ValidationInfo

from ropeode.errors import InputError, InputWarning
from ropeode.files import parse_toml, read_text
from ropeode.steppers.registry import STEPPERS
from ropeode.steppers.runge_kutta import RungeKutta
from ropeode.tableaus import Tableau
from ropeode.tableaus.stages import Matrix, Number, Row, number, same
from ropeode.validation import Input, WholePositive, bad_value, complaint, field

# What the text of such a stepper begins with.
PREFIX = "runge-kutta"
# Sums over trees of more stages take long, and other texts may be numbers of millions of digits.
_MOST_STAGES, _LONGEST, _HUGE = 256, 100, re.compile(r"[eE][+-]?[\d_]{4,}")
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
    try:
        given = _Given(**parse_toml("stepper", path, contents, "docs/howto/steppers.md for one"))
        tableau = _tableau(given)
        if (given.order or 0) > tableau.order:
            raise InputError(_too_high(given.order, tableau))
    except InputError as error:
        # Several files may be given.
        raise InputError([f"{path}: {fault}" for fault in error.problems]) from None
    return OwnTableau(tableau, tableau.order, given.name or text), tuple(_doubts(path, tableau))


def _entry(name: str, given: Any) -> Number:
    """An entry of a file; of texts, fractions and decimal numbers."""
    huge = isinstance(given, str) and (len(given) > _LONGEST or _HUGE.search(given))
    if isinstance(given, int | float | str) and not isinstance(given, bool) and not huge:
        with contextlib.suppress(ValueError, ZeroDivisionError, OverflowError):
            if math.isfinite(value := number(given)):
                return value
    allowed = 'finite numbers, and fractions as texts such as "1/3"'
    raise bad_value(name, given, allowed, 'write 0.25, or "1/4"')


def _row(name: str, given: Any) -> Row:
    if not isinstance(given, list):
        raise bad_value(name, given, "a list of numbers", _EXAMPLE)
    return tuple(_entry(f"{name}[{i}]", each) for i, each in enumerate(given, 1))


def _row_of_field(given: Any, info: ValidationInfo) -> Row | None:
    name = str(info.field_name)
    if given == []:
        raise bad_value(name, given, "a list of numbers", _EXAMPLE)
    return None if given is None else _row(name, given)


def _rows(given: Any) -> Matrix:
    if not isinstance(given, list) or not all(isinstance(row, list) for row in given):
        raise bad_value("A", given, "a list of rows, each a list", _EXAMPLE)
    return tuple(_row(f"A[{i}]", row) for i, row in enumerate(given, 1))


def _own_name(name: str | None) -> str | None:
    if name is not None and not (name.isprintable() and name.strip()):
        raise ValueError("it is no line of text")
    if name is not None and name.partition(":")[0] in STEPPERS:
        raise ValueError("a stepper of ropeode has it")
    return name


class _Given(Input):
    """The keys of a file."""

    A: Annotated[Matrix, BeforeValidator(_rows)] = field(
        ..., allowed="a list of rows, each a list", example="[[], [1]]"
    )
    b: Annotated[Row, BeforeValidator(_row_of_field)] = field(
        ..., allowed="a list of numbers", example='["1/2", "1/2"]'
    )
    c: Annotated[Row | None, BeforeValidator(_row_of_field)] = field(
        None, allowed="a list of numbers", example="[0, 1]"
    )
    name: Annotated[str | None, AfterValidator(_own_name)] = field(
        None,
        allowed="a line of text that is not the name of a stepper of ropeode",
        example='"my method"',
    )
    order: WholePositive | None = field(None, allowed="a whole number >= 1", example="4")


def _tableau(given: _Given) -> Tableau:
    """The tableau that is given.

    Raises:
        InputError: it has not the form of an explicit one.
    """
    stages = len(given.b)
    faults = []
    if stages > _MOST_STAGES:
        faults.append(_of_length("b", f"{stages} weights", _MOST_STAGES, "weights or fewer"))
    if len(given.A) != stages:
        faults.append(
            _of_length("A", f"{len(given.A)} rows", stages, "rows, one for each weight b")
        )
    if given.c and len(given.c) != stages:
        times = f"{len(given.c)} times"
        faults.append(_of_length("c", times, stages, "times, one for each weight b"))
    for i, row in enumerate(given.A):
        if row and len(row) not in (i, stages):
            allowed = f"{i} of them, or {stages} with the zeros"
            fix = f"write as many as there are slopes before k{i + 1}"
            faults.append(complaint(f"A[{i + 1}]", f"{len(row)} entries", allowed, fix))
        elif (j := next((j for j, entry in enumerate(row) if entry and j >= i), None)) is not None:
            allowed = (
                "0 there, in explicit methods: the slope "
                f"k{i + 1} would depend on k{j + 1}; implicit tableaus are not taken"
            )
            fix = "take an implicit stepper, or a solver such as diffrax:Kvaerno3"
            faults.append(complaint(f"A[{i + 1}][{j + 1}]", _plain(row[j]), allowed, fix))
    if faults:
        raise InputError(faults)
    return Tableau.of(given.A, given.b, given.c)


def _of_length(name: str, given: str, wanted: int, what: str) -> str:
    return complaint(name, given, f"{wanted} {what}", "add or drop some")


def _too_high(claimed: int | None, tableau: Tableau) -> str:
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
