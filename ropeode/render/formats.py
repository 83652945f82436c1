"""The formats that results can be written in, by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from ropeode.case_studies.report import Report
from ropeode.checking.report import CheckReport
from ropeode.errors import InputError
from ropeode.render import check as of_check
from ropeode.render import horizon as of_horizon
from ropeode.render import report as of_report
from ropeode.render.data import as_csv, as_json
from ropeode.render.documents import as_html, as_latex, as_markdown
from ropeode.render.plain_text import as_text
from ropeode.study.accuracy_table import AccuracyTable
from ropeode.study.horizon import Horizon
from ropeode.validation import unknown

FORMATS: dict[str, Callable[[AccuracyTable], str]] = {
    "text": as_text,
    "markdown": as_markdown,
    "latex": as_latex,
    "csv": as_csv,
    "json": as_json,
    "html": as_html,
}
REPORT_FORMATS: dict[str, Callable[[Report], str]] = {
    "text": of_report.as_text,
    "markdown": of_report.as_markdown,
    "latex": of_report.as_latex,
    "csv": of_report.as_csv,
    "json": of_report.as_json,
    "html": of_report.as_html,
}
HORIZON_FORMATS: dict[str, Callable[[Horizon], str]] = {
    "text": of_horizon.as_text,
    "markdown": of_horizon.as_markdown,
    "latex": of_horizon.as_latex,
    "csv": of_horizon.as_csv,
    "json": of_horizon.as_json,
    "html": of_horizon.as_html,
}

CHECK_FORMATS: dict[str, Callable[[CheckReport], str]] = {
    "text": of_check.as_text,
    "markdown": of_check.as_markdown,
    "latex": of_check.as_latex,
    "csv": of_check.as_csv,
    "json": of_check.as_json,
    "html": of_check.as_html,
}


def format_table(table: AccuracyTable, form: str = "text") -> str:
    """A table as text.

    Arguments:
        table: from `ropeode.accuracy_table`.
        form: one of `FORMATS`.

    Raises:
        InputError: there is no such format.
    """
    return _formatted(table, form, FORMATS)


def format_report(report: Report, form: str = "text") -> str:
    """A report as text.

    Arguments:
        report: from `ropeode.rope_report`.
        form: one of `REPORT_FORMATS`.

    Raises:
        InputError: there is no such format.
    """
    return _formatted(report, form, REPORT_FORMATS)


def format_horizon(study: Horizon, form: str = "text") -> str:
    """A horizon study as text.

    Arguments:
        study: from `ropeode.horizon`.
        form: one of `HORIZON_FORMATS`.

    Raises:
        InputError: there is no such format.
    """
    return _formatted(study, form, HORIZON_FORMATS)


def format_check(report: CheckReport, form: str = "text") -> str:
    """A report on a stepper as text.

    Arguments:
        report: from `ropeode.check_stepper`.
        form: one of `CHECK_FORMATS`.

    Raises:
        InputError: there is no such format.
    """
    return _formatted(report, form, CHECK_FORMATS)


def _formatted(result: Any, form: str, formats: Mapping[str, Callable[[Any], str]]) -> str:
    if form not in formats:
        raise InputError(unknown("format", form, formats))
    return formats[form](result)
