"""The report in every format, and its pictures."""

from __future__ import annotations

import csv
import dataclasses
import io
import json
import re
from html.parser import HTMLParser

import numpy as np
import pytest

from ropeode.case_studies import (
    Report,
    RoundingEffect,
    ThresholdEffect,
    draw_report,
    format_report,
    plot_contact_sheets,
    plot_report_figure,
)
from ropeode.errors import InputError
from ropeode.progress import silent
from ropeode.terminal import FORMATS
from tests.case_studies.conftest import FRAMES
from tests.render.plots.legible import assert_legible
from tests.schemas import assert_conforms

pytestmark = pytest.mark.slow

FIGURES = (1, 4, 8, 31, 36, 37)
ROW = {
    "figure",
    "stepper",
    "steps_per_frame",
    "damping",
    "claim",
    "measured",
    "verdict",
    "diverged_at",
    "settled_at",
    "frames",
}


@pytest.fixture(scope="module")
def some(report) -> Report:
    """Some figures, with effects of thresholds and rounding among them."""
    threshold = ThresholdEffect(8, "words", "speed", 0.002, "holds until frame 12")
    rounding = RoundingEffect(36, "words", "settled_at", None, 251, "holds")
    return dataclasses.replace(
        report,
        figures=tuple(each for each in report.figures if each.figure.figure in FIGURES),
        sensitive_to_thresholds=(*report.sensitive_to_thresholds, threshold),
        sensitive_to_rounding=(*report.sensitive_to_rounding, rounding),
    )


def test_a_format_that_does_not_exist(some):
    with pytest.raises(InputError, match="format: 'jsn' given"):
        format_report(some, "jsn")


@pytest.mark.parametrize("form", FORMATS)
def test_every_format_holds_the_findings(form, some):
    text = format_report(some, form)
    assert text.endswith("\n")
    assert not re.search(r"\b(nan|NaN|inf|Infinity|None)\b", text)
    plain = " ".join(text.replace("\\_", "_").replace("&#x27;", "'").split())
    for each in some.figures:
        assert each.verdict in plain
        assert str(each.figure.steps_per_frame) in plain or not each.readings
        if form != "latex":
            assert each.measured in plain
    if form != "csv":
        for compared in some.comparisons:
            assert compared.comparison.claim in plain
        assert "holds until frame 12" in plain
        if form != "json":
            assert "at rest from none becomes 251" in plain


def test_text_fits_80_columns(some):
    assert all(len(line) <= 80 for line in format_report(some).splitlines())


def test_json_schema(some):
    text = format_report(some, "json")
    assert_conforms(text)
    found = json.loads(text)
    assert found["schema"] == "ropeode.report/1"
    assert [row["figure"] for row in found["figures"]] == list(FIGURES)
    for row, each in zip(found["figures"], some.figures, strict=True):
        assert set(row) >= ROW
        assert row["verdict"] == each.verdict
        if each.motion is not None:
            assert row["diverged_at"] == each.motion.diverged_at
            assert row["settled_at"] == each.motion.settled_at
            assert row["frames"] == FRAMES
            assert {reading["meaning"] for reading in row["meanings"]} == set(each.figure.meanings)
    assert found["sensitive_to_rounding"][-1] == {
        "figure": 36, "meaning": "words", "measure": "settled_at", "value": None, "nudged": 251,
        "verdict": "holds",
    }  # fmt: skip


def test_csv_is_read_back(some):
    rows = list(csv.DictReader(io.StringIO(format_report(some, "csv"))))
    assert [int(row["figure"]) for row in rows] == list(FIGURES)
    assert set(rows[0]) >= ROW
    assert rows[1]["diverged_at"] == str(some.figures[1].motion.diverged_at)
    assert float(rows[1]["predicted_rate"]) == some.figures[1].readings[0].growth.rate


def test_the_summary_counts(some):
    verdicts = [each.verdict for each in some.figures]
    text = " ".join(format_report(some).split())
    fails = verdicts.count("does not hold")
    counts = f"{verdicts.count('holds')} hold, {fails} do{'es' * (fails == 1)} not"
    assert f"Of the claims of {len(FIGURES)} figures, {counts}" in text


def test_html_rows_are_whole(some):
    class Page(HTMLParser):
        def __init__(self):
            super().__init__()
            self.rows: list[int] = []

        def handle_starttag(self, tag, attrs):
            if tag == "tr":
                self.rows.append(0)
            elif tag in ("td", "th"):
                self.rows[-1] += 1

    page = Page()
    page.feed(format_report(some, "html"))
    assert page.rows == [9] * (1 + len(FIGURES)) + [4] * (1 + len(some.comparisons))


def test_pictures(some):
    made = draw_report(some, silent)
    assert set(made) == {f"figure-{n:02}.png" for n in FIGURES} | {"contact-sheet-1.png"}
    assert all(contents.startswith(b"\x89PNG") for contents in made.values())

    diverged = next(each for each in some.figures if each.figure.figure == 8)
    shapes, speeds, *_ = plot_report_figure(diverged).axes
    before = diverged.motion.diverged_at
    trace = shapes.get_lines()[0].get_xydata()
    np.testing.assert_array_equal(trace, diverged.readings[0].trajectory.positions[:before, -1])
    assert [line.get_xdata()[0] for line in speeds.get_lines() if line.get_linestyle() == ":"] == [
        before
    ]
    for each in some.figures:
        figure = plot_report_figure(each)
        # The rope at several times may be in one place.
        assert_legible(figure, [axes for axes in figure.axes if axes.get_yscale() == "log"])
        assert str(each.figure.figure) in figure.get_suptitle()
        for axes in figure.axes:
            if axes.get_label() != "<colorbar>":
                assert "[" in axes.get_xlabel()
                assert "[" in axes.get_ylabel()
    (sheet,) = plot_contact_sheets(some)
    assert_legible(sheet, [])
    assert len(sheet.axes) == len(FIGURES)
