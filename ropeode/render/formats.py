"""The formats of results, by name."""

from __future__ import annotations

import functools
import importlib
import importlib.util
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from ropeode.errors import InputError
from ropeode.render import markup
from ropeode.render.data import as_dict, as_lines, csv_text, json_text
from ropeode.render.documents import blocks
from ropeode.render.latex_table import latex_table
from ropeode.render.markup import Block
from ropeode.render.plain_text import as_text
from ropeode.validation import bad_value, unknown

if TYPE_CHECKING:
    from ropeode.checking.report import CheckReport
    from ropeode.study.accuracy_table import AccuracyTable
    from ropeode.study.explanation import Explanation
    from ropeode.study.horizon import Horizon


def formats_of(
    text: Callable[[Any], str],
    blocks: Callable[[Any], Sequence[Block]],
    lines: Callable[[Any], list[dict[str, Any]]],
    values: Callable[[Any], dict[str, Any]],
    drawings: Callable[[Any], Sequence[Block]] = lambda _: (),
) -> dict[str, Callable[[Any], str]]:
    """All formats of a kind of result.

    Arguments:
        text: writes it for a terminal.
        blocks: its headings, paragraphs and tables, for documents.
        lines: its lines for CSV, the columns by name.
        values: all of it as nested plain values, for JSON.
        drawings: pictures at the end of its HTML page.
    """
    return {
        "text": text,
        "markdown": lambda result: markup.markdown(blocks(result)),
        "latex": lambda result: markup.latex_part(blocks(result)),
        "csv": lambda result: csv_text(lines(result)),
        "json": lambda result: json_text(values(result)),
        "html": lambda result: markup.html_page([*blocks(result), *drawings(result)]),
    }


def _drawn(name: str, draw: str, result: Any) -> list[Block]:
    """A picture of a result, where matplotlib is installed."""
    if importlib.util.find_spec("matplotlib") is None:
        return []
    from ropeode.render.plots.files import figure_bytes

    function = getattr(importlib.import_module(f"ropeode.render.plots.{name}"), draw)
    return [markup.Drawing(figure_bytes(function(result), ".svg").decode())]


FORMATS = {
    **formats_of(
        as_text,
        blocks,
        as_lines,
        as_dict,
        functools.partial(_drawn, "convergence", "plot_convergence"),
    ),
    "latex": latex_table,
}


def format_table(table: AccuracyTable, form: str = "text", **layout: Any) -> str:
    """A table as text.

    Arguments:
        table: from `ropeode.accuracy_table`.
        form: one of `FORMATS`.
        layout: of LaTeX only: `columns` (some of `ropeode.render.latex_table.COLUMNS`), `caption`
            (in LaTeX) and `label`.

    Raises:
        InputError: there is no such format, or the layout cannot be used.
    """
    if layout and form != "latex":
        raise bad_value("format", form, f"latex, with {', '.join(layout)}", "choose latex")
    return formatted(table, form, {**FORMATS, "latex": functools.partial(latex_table, **layout)})


def format_horizon(study: Horizon, form: str = "text") -> str:
    """A horizon study as text.

    Arguments:
        study: from `ropeode.horizon`.
        form: one of `FORMATS`.

    Raises:
        InputError: there is no such format.
    """
    # Each kind of result is imported with its own renderer: few commands have two.
    from ropeode.render import horizon as of

    drawn = functools.partial(_drawn, "horizon", "plot_horizon")
    forms = formats_of(of.as_text, of.blocks, of.as_lines, of.as_dict, drawn)
    return formatted(study, form, forms)


def format_check(report: CheckReport, form: str = "text") -> str:
    """A report on a stepper as text.

    Arguments:
        report: from `ropeode.check_stepper`.
        form: one of `FORMATS`.

    Raises:
        InputError: there is no such format.
    """
    from ropeode.render import check as of

    return formatted(report, form, formats_of(of.as_text, of.blocks, of.as_lines, of.as_dict))


def format_explanation(explanation: Explanation, form: str = "text") -> str:
    """What a stepper does, as text.

    Arguments:
        explanation: from `ropeode.explain_stepper`.
        form: one of `FORMATS`.

    Raises:
        InputError: there is no such format.
    """
    from ropeode.render import explanation as of

    return formatted(explanation, form, formats_of(of.as_text, of.blocks, of.as_lines, of.as_dict))


def formatted(result: Any, form: str, formats: Mapping[str, Callable[[Any], str]]) -> str:
    """A result as text, in the format of this name.

    Raises:
        InputError: there is no such format.
    """
    if form not in formats:
        raise InputError(unknown("format", form, formats))
    return formats[form](result)
