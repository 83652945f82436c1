"""The formats of results, by name."""

from __future__ import annotations

import csv
import functools
import importlib
import importlib.util
import io
import json
import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from ropeode.errors import InputError
from ropeode.json_form import json_of
from ropeode.render import markup
from ropeode.render.accuracy_table import latex_table
from ropeode.render.markup import Block
from ropeode.render.results import blocks, rows
from ropeode.study import AccuracyTable
from ropeode.validation import bad_value, check_kind, unknown

if TYPE_CHECKING:
    from ropeode.checking import CheckReport
    from ropeode.study import Explanation, Horizon, WorkPrecision


def _drawn(name: str, draw: str, result: Any) -> list[Block]:
    """A picture of a result, where matplotlib is installed."""
    if importlib.util.find_spec("matplotlib") is None:
        return []
    from ropeode.render.plots.style import figure_bytes

    function = getattr(importlib.import_module(f"ropeode.render.plots.{name}"), draw)
    return [markup.Drawing(figure_bytes(function(result), ".svg").decode())]


def _drawn_for_each_cost(study: WorkPrecision) -> list[Block]:
    """The pictures of a work-precision study, whose points say their values."""
    if importlib.util.find_spec("matplotlib") is None:
        return []
    from ropeode.render.plots.work_precision import picture_with_hover
    from ropeode.study import COSTS

    return [markup.Drawing(picture_with_hover(study, cost)) for cost in COSTS]


def _json(result: Any) -> str:
    """A result as JSON, which begins with the name of its schema."""
    form = {"schema": result.SCHEMA, **json_of(result)}
    return json.dumps(form, indent=2, allow_nan=False, ensure_ascii=False) + "\n"


def _csv(result: Any) -> str:
    """The rows of a result as CSV, under the names of all columns; what does not exist is empty."""
    lines = rows(result)
    text = io.StringIO()
    names = list(dict.fromkeys(name for line in lines for name in line))
    writer = csv.DictWriter(text, fieldnames=names, lineterminator="\n")
    writer.writeheader()
    writer.writerows({name: _finite(value) for name, value in line.items()} for line in lines)
    return text.getvalue()


def _finite(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value


FORMATS: dict[str, Callable[..., str]] = {
    "text": lambda result: markup.plain(blocks(result)),
    "markdown": lambda result: markup.markdown(blocks(result)),
    "latex": lambda result: markup.latex_part(blocks(result)),
    "csv": _csv,
    "json": _json,
    "html": lambda result, pictures=(): markup.html_page([*blocks(result), *pictures]),
}


def formatted(
    result: Any, form: str, pictures: Callable[[Any], Sequence[Block]] = lambda _: ()
) -> str:
    """A result as text.

    Arguments:
        result: of any kind that `blocks` and `rows` know.
        form: one of `FORMATS`.
        pictures: at the end of its HTML page.

    Raises:
        InputError: there is no such format.
    """
    if form not in FORMATS:
        raise InputError(unknown("format", form, FORMATS))
    return FORMATS[form](result, *([pictures(result)] if form == "html" else []))


def format_table(table: AccuracyTable, form: str = "text", **layout: Any) -> str:
    """A table as text.

    Arguments:
        table: from `ropeode.accuracy_table`.
        form: one of `FORMATS`.
        layout: of LaTeX only: `columns` (some of `ropeode.render.LATEX_COLUMNS`), `caption` (in
            LaTeX) and `label`.

    Raises:
        InputError: there is no such format, or the layout cannot be used.

    Examples:
        >>> from ropeode import Rope, accuracy_table, format_table
        >>> table = accuracy_table(Rope(num_nodes=4).problem(frames=3), ["rk4"], [16, 32, 64])
        >>> print(format_table(table))
        Accuracy of steppers: rope, 4 nodes, damping 0.01, 3 frames
        Error: largest distance of a node, over samples 1 to 3.
        ...
        stepper  expected  observed    95% interval  steps used  verdict
        rk4             4     3.9...  [3.6..., 4.2...]    16 to 64  converges
        ...
    """
    check_kind("table", table, AccuracyTable, "accuracy_table")
    if form == "latex":
        return latex_table(table, **layout)
    if layout:
        raise bad_value("format", form, f"latex, with {', '.join(layout)}", "choose latex")
    return formatted(table, form, functools.partial(_drawn, "convergence", "plot_convergence"))


def format_horizon(study: Horizon, form: str = "text") -> str:
    """A horizon study as text.

    Arguments:
        study: from `ropeode.horizon`.
        form: one of `FORMATS`.

    Raises:
        InputError: there is no such format.

    Examples:
        >>> from ropeode import Rope, format_horizon, horizon
        >>> print(format_horizon(horizon(Rope(num_nodes=4).problem(frames=3), spans=[3.0])))
        Horizon of float64 references: rope, 4 nodes, damping 0.01, 3 frames
        ...
    """
    from ropeode.study import Horizon

    check_kind("study", study, Horizon, "horizon")
    drawn = functools.partial(_drawn, "horizon", "plot_horizon")
    return formatted(study, form, drawn)


def format_work_precision(study: WorkPrecision, form: str = "text") -> str:
    """A work-precision study as text.

    Arguments:
        study: from `ropeode.work_precision`.
        form: one of `FORMATS`; `html` has a picture for each cost, whose points say their values
            where the pointer is.

    Raises:
        InputError: there is no such format.

    Examples:
        >>> from ropeode import Rope, format_work_precision, work_precision
        >>> rope = Rope(num_nodes=4).problem(frames=3)
        >>> study = work_precision(rope, ["rk4"], steps_per_frame=[16, 64], rounds=1)
        >>> print(format_work_precision(study))
        Work and precision: rope, 4 nodes, damping 0.01, 3 frames
        ...
    """
    from ropeode.study import WorkPrecision

    check_kind("study", study, WorkPrecision, "work_precision")
    return formatted(study, form, _drawn_for_each_cost)


def format_check(report: CheckReport, form: str = "text") -> str:
    """A report on a stepper as text.

    Arguments:
        report: from `ropeode.check_stepper`.
        form: one of `FORMATS`.

    Raises:
        InputError: there is no such format.

    Examples:
        >>> from ropeode import check_stepper, format_check
        >>> report = check_stepper("rk4", expected_order=4, only=["order-driven"])
        >>> print(format_check(report))
        Check of rk4: claimed to be of order 4
        <BLANKLINE>
        Right: 1 of 1 check passed, none failed (... s). On the problem 'driven' its order
        is ...; expected 4.
        <BLANKLINE>
        ok     order-driven  positions order ...
    """
    from ropeode.checking import CheckReport

    check_kind("report", report, CheckReport, "check_stepper")
    return formatted(report, form)


def format_explanation(explanation: Explanation, form: str = "text") -> str:
    """What a stepper does, as text.

    Arguments:
        explanation: from `ropeode.explain_stepper`.
        form: one of `FORMATS`.

    Raises:
        InputError: there is no such format.

    Examples:
        >>> from ropeode import Rope, explain_stepper, format_explanation
        >>> explained = explain_stepper("explicit-euler", Rope(num_nodes=4).problem(frames=3))
        >>> print(format_explanation(explained))
        explicit-euler: rope, 4 nodes, damping 0.01, 3 frames
        <BLANKLINE>
        In theory its order on this problem is 1; in its runs its order is ...
        <BLANKLINE>
        ...
    """
    from ropeode.study import Explanation

    check_kind("explanation", explanation, Explanation, "explain_stepper")
    return formatted(explanation, form)
